// Pass refine_vote: finds the surface of the next pixels of the worklist by the votes around each. Pixels that change
// append their neighbours in the band. 16 threads process a pixel, each a column of its window. Workgroups share a
// wave; in the last run, a single one goes on until the worklist is empty.
// twin: `move_edges` in src/depth/refine/align.rs, src/depth/refine/votes.rs

struct Wave {
    first: u32,     // index in `counts` of the length of the round's first wave
    at: u32,        // index of this wave's length; the next one's follows
    marks: u32,     // flag for the pixels that are appended to the worklist
}

@group(0) @binding(1) var<uniform> wave: Wave;
@group(0) @binding(2) var<storage, read> measures: array<f32>;
@group(0) @binding(3) var<storage, read> spatial_weights: array<f32>;            // spatial weights of votes, row by row
@group(0) @binding(4) var<storage, read> votes: array<vec2<u32>>;       // as packed by `refine_band`
@group(0) @binding(5) var<storage, read_write> inverse: array<f32>;
@group(0) @binding(6) var<storage, read_write> flags: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> worklist: array<u32>;
@group(0) @binding(8) var<storage, read_write> counts: array<atomic<u32>>;

// The range of votes is halved until it is one surface, which takes fewer iterations for any range of depths.
const MAX_ITERATIONS = 64u;

var<workgroup> begin: u32;
var<workgroup> count: u32;
var<workgroup> more: atomic<u32>;

// Appends a neighbour to the next wave.
fn append_to_wave(k: u32, next: u32) {
    if (atomicAnd(&flags[k], ~BAND) & BAND) != 0u {
        atomicOr(&flags[k], wave.marks);
        worklist[next + atomicAdd(&counts[wave.at + 1u], 1u)] = k;
    }
}

fn process_pixel(k: u32, is_listed: bool, next: u32, thread: u32) {
    let lane = thread % LANES;
    let first = thread - lane;
    let x = k % frame.size.x;
    let y = k / frame.size.x;
    let center = votes[k];
    let own = compute_column(vec2(x, y), unpack_color(center.y), lane);
    sums[thread] = vec4(own.total, 0.0, 0.0);
    ends[thread] = own.range;
    workgroupBarrier();
    let totals = sum_lanes(first);
    var low = min_max_lanes(first).x;
    var high = min_max_lanes(first).y;
    let similar_fraction = totals.y / totals.x;
    let fourth = similar_fraction * similar_fraction * similar_fraction * similar_fraction;
    let hysteresis = HYSTERESIS + LOW_CONTRAST_HYSTERESIS * fourth * fourth;
    let current = bitcast<f32>(center.x);
    var mean = current;
    var is_split = true;
    for (var iteration = 0u; iteration < MAX_ITERATIONS; iteration++) {
        is_split = is_split && high - low > depth_step_at(measures[STEP], high);
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
        // Weights of the near and of the far half, and their products with the depths; the votes next to the middle.
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
        let all = sum_lanes(first);
        let middles = min_max_lanes(first);
        let near = all.x * select(1.0, hysteresis, current > middle && current <= high);
        let far = all.y * select(1.0, hysteresis, current <= middle && current >= low);
        if is_split {
            let is_near = near > far;
            let changed = select(vec2(low, middles.y), vec2(middles.x, high), is_near);
            mean = select(all.w / all.y, all.z / all.x, is_near);
            // Rounding may leave an unchanged range.
            is_split = any(changed != vec2(low, high));
            low = changed.x;
            high = changed.y;
        }
    }
    let slack = 0.5 * depth_step_at(measures[STEP], current);
    let is_on_it = current >= low - slack && current <= high + slack && abs(current - mean) < slack;
    if !is_listed || is_on_it || mean == current {
        return;
    }
    if lane == 0u {
        inverse[k] = mean;
        atomicOr(&flags[k], MOVED_NOW);
    }
    let last = frame.size - 1u;
    if lane == 1u && x > 0u {
        append_to_wave(k - 1u, next);
    } else if lane == 2u && x < last.x {
        append_to_wave(k + 1u, next);
    } else if lane == 3u && y > 0u {
        append_to_wave(k - frame.size.x, next);
    } else if lane == 4u && y < last.y {
        append_to_wave(k + frame.size.x, next);
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
            process_pixel(worklist[min(number, end - 1u)], number < end, next, thread);
            workgroupBarrier();
        }
        if DOWN == 0u {
            break;
        }
        // Ends, because each pixel is appended once.
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
