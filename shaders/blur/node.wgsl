// Shared by the filter passes.

// The node of the bank nearest to a radius. twin: src/bokeh/bank.rs
fn nearest_node(radius_px: f32, steps_per_px: f32, nodes: u32) -> u32 {
    var node = u32(radius_px * steps_per_px + 0.5);
    if radius_px >= OCTAVES_FROM_PX {
        // The bits of a float are linear within each octave.
        let above = bitcast<u32>(radius_px) - bitcast<u32>(OCTAVES_FROM_PX) + (1u << (OCTAVE_SHIFT - 1u));
        node = u32(OCTAVES_FROM_PX * steps_per_px) + (above >> OCTAVE_SHIFT);
    }
    return min(node, nodes - 1u);
}
