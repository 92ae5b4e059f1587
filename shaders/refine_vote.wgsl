// Pass refine_vote: the next pixels of the list are told their surface, by the votes of the window around each. Those that
// turn out to lie on another surface put their neighbours in the band on the list. 16 threads do a pixel, each a column of
// its window. Workgroups take turns with the pixels of a wave; in the last run, one goes on until nobody puts any more.

struct Wave {
    first: u32,     // where the numbers of pixels of all waves of the round begin in `counts`
    at: u32,        // where that of this one is; the next one's is after it
    marks: u32,     // what those are marked with that are put on the list
}

@group(0) @binding(1) var<uniform> wave: Wave;
@group(0) @binding(2) var<storage, read> measures: array<f32>;
@group(0) @binding(3) var<storage, read> nearby: array<f32>;            // weights of votes by distance, row by row
@group(0) @binding(4) var<storage, read> votes: array<vec2<u32>>;       // as `refine_band` has left them
@group(0) @binding(5) var<storage, read_write> inverse: array<f32>;
@group(0) @binding(6) var<storage, read_write> flags: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> front: array<u32>;
@group(0) @binding(8) var<storage, read_write> counts: array<atomic<u32>>;

// The range of votes is halved until it is one surface; no range of depths takes so many turns.
const MOST_TURNS = 64u;

var<workgroup> begin: u32;
var<workgroup> count: u32;
var<workgroup> more: atomic<u32>;

// Puts a neighbour on the list of the next wave.
fn put(k: u32, next: u32) {
    if (atomicAnd(&flags[k], ~BAND) & BAND) != 0u {
        atomicOr(&flags[k], wave.marks);
        front[next + atomicAdd(&counts[wave.at + 1u], 1u)] = k;
    }
}

fn ask(k: u32, is_asked: bool, next: u32, thread: u32) {
    let lane = thread % LANES;
    let first = thread - lane;
    let x = k % frame.size.x;
    let y = k / frame.size.x;
    let center = votes[k];
    let own = column_of(vec2(x, y), color_of(center.y), lane);
    sums[thread] = vec4(own.total, 0.0, 0.0);
    ends[thread] = own.range;
    workgroupBarrier();
    let totals = sum_of(first);
    var low = ends_of(first).x;
    var high = ends_of(first).y;
    let share = totals.y / totals.x;
    let fourth = share * share * share * share;
    let loyalty = LOYALTY + CONTRAST_LOYALTY * fourth * fourth;
    let current = bitcast<f32>(center.x);
    var mean = current;
    var is_split = true;
    for (var turn = 0u; turn < MOST_TURNS; turn++) {
        is_split = is_split && high - low > jump_at(measures[STEP], high);
        if thread == 0u {
            atomicStore(&more, 0u);
        }
        workgroupBarrier();
        if is_split {
            atomicStore(&more, 1u);
        }
        if workgroupUniformLoad(&more) == 0u {
            break;
        }
        let middle = 0.5 * (low + high);
        // Weights of the near and of the far half, and these times the depths; the votes nearest to the middle.
        var halves = vec4(0.0);
        var inner = vec2(high, low);
        for (var row = 0u; row < ROWS; row++) {
            let v = own.depth[row];
            let is_near = v > middle && v <= high && own.weight[row] > 0.0;
            let is_far = v <= middle && v >= low && own.weight[row] > 0.0;
            let w = select(vec2(0.0), vec2(own.weight[row]), vec2(is_near, is_far));
            halves += vec4(w, w * v);
            inner = select(inner, vec2(min(inner.x, v), max(inner.y, v)), vec2(is_near, is_far));
        }
        sums[thread] = halves;
        ends[thread] = inner;
        workgroupBarrier();
        let all = sum_of(first);
        let middles = ends_of(first);
        let near = all.x * select(1.0, loyalty, current > middle && current <= high);
        let far = all.y * select(1.0, loyalty, current <= middle && current >= low);
        if is_split {
            let is_near = near > far;
            let changed = select(vec2(low, middles.y), vec2(middles.x, high), is_near);
            mean = select(all.w / all.y, all.z / all.x, is_near);
            // Rounding may leave nothing to split.
            is_split = any(changed != vec2(low, high));
            low = changed.x;
            high = changed.y;
        }
    }
    let slack = 0.5 * jump_at(measures[STEP], current);
    let is_on_it = current >= low - slack && current <= high + slack && abs(current - mean) < slack;
    if !is_asked || is_on_it || mean == current {
        return;
    }
    if lane == 0u {
        inverse[k] = mean;
        atomicOr(&flags[k], MOVED_NOW);
    }
    let last = frame.size - 1u;
    if lane == 1u && x > 0u {
        put(k - 1u, next);
    } else if lane == 2u && x < last.x {
        put(k + 1u, next);
    } else if lane == 3u && y > 0u {
        put(k - frame.size.x, next);
    } else if lane == 4u && y < last.y {
        put(k + frame.size.x, next);
    }
}

@compute @workgroup_size(LANES * PIXELS)
fn refine_vote(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) thread: u32) {
    if thread == 0u {
        begin = 0u;
        for (var before = wave.first; before < wave.at; before++) {
            begin += atomicLoad(&counts[before]);
        }
        count = atomicLoad(&counts[wave.at]);
    }
    var start = workgroupUniformLoad(&begin);
    let next = start + workgroupUniformLoad(&count);
    var end = next;
    loop {
        for (var first = start + group.x * PIXELS; first < end; first += groups.x * PIXELS) {
            let number = first + thread / LANES;
            ask(front[min(number, end - 1u)], number < end, next, thread);
            workgroupBarrier();
        }
        if DOWN == 0u {
            break;
        }
        // Each pixel is put once, so that there is an end.
        storageBarrier();
        if thread == 0u {
            count = next + atomicLoad(&counts[wave.at + 1u]);
        }
        start = end;
        end = workgroupUniformLoad(&count);
        if start == end {
            break;
        }
    }
}
