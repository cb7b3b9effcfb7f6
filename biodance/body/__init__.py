"""Who moves: tables, the human, HOAP-3, scaling, joint and torque limits, boxes; model export."""
