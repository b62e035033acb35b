"""What is said in terminals: best grasps, state, differences, exports."""
