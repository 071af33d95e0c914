"""One function a workflow rule: inputs in, labelled dataset out.  The only layer that knows all others."""
