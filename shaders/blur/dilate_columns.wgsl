// Pass dilate_columns: dilates the silhouettes down the columns of their grid, after the rows: above 0 within their
// radius.
// twin: src/bokeh/cpu/silhouettes.rs

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> row_dilated: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> dilated: array<vec4<f32>>;

@compute @workgroup_size(SMALL_TILE, SMALL_TILE)
fn dilate_columns(@builtin(global_invocation_id) id: vec3<u32>) {
    let cells = silhouette_grid_size(frame.size);
    if any(id.xy >= cells) {
        return;
    }
    let radius = max_radius_cells();
    var highest = vec4(-1.0);
    for (var y = id.y - min(id.y, radius); y <= min(id.y + radius, cells.y - 1u); y++) {
        let distance_px = f32((max(y, id.y) - min(y, id.y)) * SILHOUETTE_CELL);
        highest = max(highest, row_dilated[y * cells.x + id.x] - distance_px * distance_px);
    }
    dilated[id.y * cells.x + id.x] = highest;
}
