// Shared by the passes that note the range of CoC of every tile of the picture, so that later ones can leave out what
// is not there.

var<workgroup> lowest: atomic<i32>;
var<workgroup> highest: atomic<i32>;

// Integers in the order of the floats, and back.
fn key_of(value: f32) -> i32 {
    let bits = bitcast<i32>(value);
    return bits ^ ((bits >> 31u) & 0x7fffffff);
}

fn value_of(key: i32) -> f32 {
    return bitcast<f32>(key ^ ((key >> 31u) & 0x7fffffff));
}

fn range_add(coc_px: f32) {
    atomicMin(&lowest, key_of(coc_px));
    atomicMax(&highest, key_of(coc_px));
}
