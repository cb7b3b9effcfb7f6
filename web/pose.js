// Finds the 17 points of a person in a small picture: MoveNet Lightning in tfjs on WebAssembly, as a worker of the page
// that leads. All that it needs comes with the first message; it asks nobody for anything.
import { env, ready, setBackend, tensor } from "@tensorflow/tfjs-core";
import { loadGraphModel } from "@tensorflow/tfjs-converter";
import { setWasmPaths } from "@tensorflow/tfjs-backend-wasm";

const SIZE = 192; // pixels a side that the model sees
let model = null;

async function start({ wasm, topology, weights }) {
  env().platform.fetch = async () => new Response(wasm); // tfjs asks for its kernels alone; they are here
  setWasmPaths("", true);
  if (!(await setBackend("wasm"))) throw new Error("no WebAssembly with SIMD");
  await ready();
  const { modelTopology, weightsManifest, signature, format } = JSON.parse(topology);
  const weightSpecs = weightsManifest.flatMap((one) => one.weights);
  model = await loadGraphModel({
    load: async () => ({ modelTopology, weightSpecs, weightData: weights, signature, format }),
  });
  await find(new Uint8ClampedArray(4 * SIZE * SIZE)); // the first run compiles
}

async function find(pixels) {
  const colours = new Int32Array(3 * SIZE * SIZE);
  for (let k = 0, i = 0; k < pixels.length; k += 4) {
    colours[i++] = pixels[k];
    colours[i++] = pixels[k + 1];
    colours[i++] = pixels[k + 2];
  }
  const picture = tensor(colours, [1, SIZE, SIZE, 3], "int32");
  const found = model.execute(picture);
  const points = await found.data(); // 17 times y, x (0 to 1 of the picture) and how sure, 0 to 1
  picture.dispose();
  found.dispose();
  return Float32Array.from(points);
}

onmessage = async ({ data }) => {
  try {
    if (data.wasm) {
      await start(data);
      postMessage({ ready: true });
    } else {
      const began = performance.now();
      const points = await find(new Uint8ClampedArray(data.pixels));
      postMessage({ points, tag: data.tag, ms: performance.now() - began });
    }
  } catch (error) {
    postMessage({ error: String(error) });
  }
};
