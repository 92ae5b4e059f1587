// Included by the passes that follow runs of a component. The label of a run's first pixel is the first pixel of a run
// of the same component, further up or left or its own; that of the other pixels is the run's first one. Labels only
// ever decrease, and a label read meanwhile stays within the component: so no invocation waits, and every loop ends.

@group(0) @binding(0) var<storage, read> map: array<u32>;
@group(0) @binding(1) var<storage, read_write> labels: array<atomic<u32>>;

// Returns the root: the first pixel of the run at the end of the chain of labels; shortens the chain.
fn root_of(run: u32) -> u32 {
    var at = run;
    var label = atomicLoad(&labels[at]);
    while label < at {
        let next = atomicLoad(&labels[label]);
        if next < label {
            atomicMin(&labels[at], next);
        }
        at = label;
        label = next;
    }
    return at;
}
