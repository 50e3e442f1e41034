"""What surrounds the work: the virtual camera, measures against its truth, figures and explorers."""
