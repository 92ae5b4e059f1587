//! SIMD dispatch: run-time choice of the vector instructions.
//!
//! Every pass is a [`pulp::WithSimd`]: compiled once per instruction set (AVX-512 with the feature `avx512`, AVX2 with
//! FMA, NEON, or the target's baseline), of which the best one available runs. Simple loops are vectorised by the
//! compiler; the filters use explicit vectors.

use pulp::{Arch, Simd};

use super::aligned::CACHE_LINE_BYTES;

/// Computes `a * b + c`: fused if the processor has an instruction for it, because the library call would be slow.
#[inline(always)]
pub fn madd<S: Simd>(a: f32, b: f32, c: f32) -> f32 {
    if S::IS_SCALAR { a * b + c } else { a.mul_add(b, c) }
}

/// [`madd`] for vectors.
#[inline(always)]
pub fn fma<S: Simd>(simd: S, a: S::f32s, b: S::f32s, c: S::f32s) -> S::f32s {
    if S::IS_SCALAR { simd.add_f32s(simd.mul_f32s(a, b), c) } else { simd.mul_add_f32s(a, b, c) }
}

/// Returns a number from 0 to 2^22, rounded. At 2^23 a float has no fraction, and its lowest bits are the integer: vectors
/// do this in one addition.
#[inline(always)]
pub fn round_to_integer(value: f32) -> u32 {
    const TO_INTEGER: f32 = (1 << 23) as f32;
    (value + TO_INTEGER).to_bits().wrapping_sub(TO_INTEGER.to_bits())
}

/// Loads one vector of `values`, from index `at` on.
#[inline(always)]
pub fn load<S: Simd>(values: &[f32], at: usize) -> S::f32s {
    S::as_simd_f32s(&values[at..at + S::F32_LANES]).0[0]
}

/// Stores one vector at index `at`.
#[inline(always)]
pub fn store<S: Simd>(values: &mut [f32], at: usize, vector: S::f32s) {
    S::as_mut_simd_f32s(&mut values[at..at + S::F32_LANES]).0[0] = vector;
}

/// Returns the absolute values. [`Simd::abs_f32s`] calls a function for every vector, which the compiler does not inline.
#[inline(always)]
pub fn abs<S: Simd>(simd: S, values: S::f32s) -> S::f32s {
    simd.max_f32s(values, simd.sub_f32s(simd.splat_f32s(0.0), values))
}

/// Returns the name of the instruction set, for the report.
pub fn instruction_set(arch: Arch) -> &'static str {
    match arch {
        #[cfg(all(target_arch = "x86_64", feature = "avx512"))]
        Arch::V4(_) => "AVX-512",
        #[cfg(target_arch = "x86_64")]
        Arch::V3(_) => "AVX2",
        #[cfg(target_arch = "aarch64")]
        Arch::Neon(_) => "NEON",
        _ => "baseline",
    }
}

/// Prefetches the cache lines of `values`, for passes with strides that the hardware prefetcher does not recognise.
#[allow(unsafe_code)]
#[inline(always)]
pub fn prefetch<T>(values: &[T]) {
    #[cfg(not(target_arch = "x86_64"))]
    let _ = values;
    #[cfg(target_arch = "x86_64")]
    for at in (0..values.len()).step_by(CACHE_LINE_BYTES / size_of::<T>()) {
        use std::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
        // SAFETY: a prefetch has no effect that a program can see, whatever the address.
        unsafe { _mm_prefetch::<_MM_HINT_T1>(values[at..].as_ptr().cast()) };
    }
}
