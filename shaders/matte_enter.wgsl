// Shared by the passes that enter pixels of a cell, which is a workgroup: what these ask is the same for all of them that lie
// between the same surfaces. Such a pass has `cells`, `places`, `entries` and `colors`.

const PIXELS = CELL * CELL;

// Which pixels are entered, as bits; their entries, inverse depths of their surfaces, and answers, in the order of the cell.
var<workgroup> chosen: array<atomic<u32>, 2>;
var<workgroup> own_entries: array<u32, PIXELS>;
var<workgroup> ends: array<vec2<f32>, PIXELS>;
var<workgroup> answers: array<u32, PIXELS>;

// How many pixels are entered, of which each thread chooses its own, or not.
fn choose(thread: u32, is_chosen: bool) -> u32 {
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

// How many pixels are entered before that of a thread.
fn chosen_before(thread: u32) -> u32 {
    let before = countOneBits(atomicLoad(&chosen[thread / WORD]) & ((1u << (thread % WORD)) - 1u));
    return before + select(0u, countOneBits(atomicLoad(&chosen[0])), thread >= WORD);
}

// Gives so many pixels of a cell their answers, by its last one, if there is any.
fn ask(cell: u32, answered: u32, count: u32) {
    var last = answered;
    var surfaces = vec2(0.0);
    if last > 0u {
        surfaces = vec2(entries[last - 1u].near, entries[last - 1u].far);
    }
    for (var k = 0u; k < count; k++) {
        if last == 0u || any(abs(surfaces - ends[k]) > vec2(frame.jump)) {
            last = own_entries[k] + 1u;
            surfaces = ends[k];
        }
        answers[k] = last - 1u;
    }
    cells[cell].answered = last;
}

// Enters so many pixels of a cell; every thread calls it. What a thread has of its own, it has where it chose it: the entry,
// the pixel, its surfaces, and its labels. Whether both surfaces have any pixels.
fn enter(cell: vec2<u32>, answered: u32, count: u32, thread: u32,
         is_chosen: bool, entry: u32, at: u32, surfaces: vec2<f32>, labels: u32) -> bool {
    let rank = chosen_before(thread);
    if is_chosen {
        own_entries[rank] = entry;
        ends[rank] = surfaces;
    }
    workgroupBarrier();
    if thread == 0u {
        ask(cell.y * cells_across() + cell.x, answered, count);
    }
    workgroupBarrier();
    var answer = 0u;
    if is_chosen {
        answer = answers[rank];
        entries[entry].at = at;
        entries[entry].near = surfaces.x;
        entries[entry].far = surfaces.y;
        entries[entry].answer = answer;
        entries[entry].share = 0.0;
        atomicStore(&places[at], ENTERED | entry);
        var flags = labels;
        if answer == entry && find_colors(cell, surfaces.x, surfaces.y, answer) {
            flags |= FOUND;
        }
        atomicStore(&entries[entry].flags, flags);
    }
    storageBarrier();
    if !is_chosen {
        return false;
    }
    if (atomicLoad(&entries[answer].flags) & FOUND) == 0u {
        atomicOr(&entries[entry].flags, LONE);
        return false;
    }
    compare(entry, labels);
    return true;
}
