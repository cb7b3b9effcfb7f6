"""Who moves: tables, the human, HOAP-3, the planar chain, scaling, joint and torque limits, boxes; model export."""
