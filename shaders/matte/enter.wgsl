// Included by passes that create the entries of a cell, one workgroup a cell: entries of one cell between the same
// surfaces share one colour model. The passes bind `cells`, `places`, `entries` and `colors`.
// twin: src/depth/matting/clusters/color_models.rs

const PIXELS = CELL * CELL;

// The chosen pixels of the cell, as bits; and in their order: entries, inverse depths of both surfaces, models.
var<workgroup> chosen: array<atomic<u32>, 2>;
var<workgroup> own_entries: array<u32, PIXELS>;
var<workgroup> ends: array<vec2<f32>, PIXELS>;
var<workgroup> models: array<u32, PIXELS>;

// Number of chosen pixels; every thread calls it for its own pixel.
fn count_chosen(thread: u32, is_chosen: bool) -> u32 {
    if thread < 2u {
        atomicStore(&chosen[thread], 0u);
    }
    workgroupBarrier();
    if is_chosen {
        atomicOr(&chosen[thread / WORD], 1u << (thread % WORD));
    }
    workgroupBarrier();
    return countOneBits(workgroupUniformLoad(&chosen[0])) + countOneBits(workgroupUniformLoad(&chosen[1]));
}

// Number of chosen pixels before that of a thread.
fn rank_among_chosen(thread: u32) -> u32 {
    let before = countOneBits(atomicLoad(&chosen[thread / WORD]) & ((1u << (thread % WORD)) - 1u));
    return before + select(0u, countOneBits(atomicLoad(&chosen[0])), thread >= WORD);
}

// Assigns the chosen pixels of a cell to models: to the latest one if its surfaces are as far, or else to a new one.
fn assign_models(cell: u32, latest_model: u32, count: u32) {
    var last = latest_model;
    var surfaces = vec2(0.0);
    if last > 0u {
        surfaces = vec2(entries[last - 1u].near, entries[last - 1u].far);
    }
    for (var k = 0u; k < count; k++) {
        if last == 0u || any(abs(surfaces - ends[k]) > vec2(frame.depth_step)) {
            last = own_entries[k] + 1u;
            surfaces = ends[k];
        }
        models[k] = last - 1u;
    }
    cells[cell].latest_model = last;
}

// Creates the entries of the chosen pixels of a cell; every thread calls it, with the entry, the pixel, its surfaces
// and its labels if it is chosen. Returns whether both surfaces have pixels nearby.
fn create_entries(cell: vec2<u32>, latest_model: u32, count: u32, thread: u32,
                  is_chosen: bool, entry: u32, at: u32, surfaces: vec2<f32>, labels: u32) -> bool {
    let rank = rank_among_chosen(thread);
    if is_chosen {
        own_entries[rank] = entry;
        ends[rank] = surfaces;
    }
    workgroupBarrier();
    if thread == 0u {
        assign_models(cell.y * cells_across() + cell.x, latest_model, count);
    }
    workgroupBarrier();
    var model = 0u;
    if is_chosen {
        model = models[rank];
        entries[entry].at = at;
        entries[entry].near = surfaces.x;
        entries[entry].far = surfaces.y;
        entries[entry].model = model;
        entries[entry].alpha = 0.0;
        atomicStore(&places[at], ENTERED | entry);
        var flags = labels;
        if model == entry && find_colors(cell, surfaces.x, surfaces.y, model) {
            flags |= FOUND;
        }
        atomicStore(&entries[entry].flags, flags);
    }
    storageBarrier();
    if !is_chosen {
        return false;
    }
    if (atomicLoad(&entries[model].flags) & FOUND) == 0u {
        atomicOr(&entries[entry].flags, LONE);
        return false;
    }
    evaluate_color(entry, labels);
    return true;
}
