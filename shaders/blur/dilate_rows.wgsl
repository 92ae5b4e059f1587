// Pass dilate_rows: dilates the silhouettes along the rows of their grid, the maximum of distance^2 minus the squared
// offset.
// twin: src/bokeh/cpu/silhouettes.rs

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> marks: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> row_dilated: array<vec4<f32>>;

@compute @workgroup_size(SMALL_TILE, SMALL_TILE)
fn dilate_rows(@builtin(global_invocation_id) id: vec3<u32>) {
    let cells = silhouette_grid_size(frame.size);
    if any(id.xy >= cells) {
        return;
    }
    let radius = max_radius_cells();
    var highest = vec4(-1.0);
    for (var x = id.x - min(id.x, radius); x <= min(id.x + radius, cells.x - 1u); x++) {
        let mark = marks[id.y * cells.x + x];
        let distance_px = f32((max(x, id.x) - min(x, id.x)) * SILHOUETTE_CELL);
        highest = max(highest, select(vec4(-1.0), mark * mark - distance_px * distance_px, mark > vec4(distance_px)));
    }
    row_dilated[id.y * cells.x + id.x] = highest;
}
