//! Percentiles in fixed memory: counts over buckets of time that grow with the time itself.

/// Every power of two is split into `2^SPLIT_BITS` equal buckets. A bucket is read at its middle, so the error is at
/// most half of 1/64 of the value: 0.8 %.
const SPLIT_BITS: u32 = 6;
const SPLIT: u64 = 1 << SPLIT_BITS;
/// Times of `2^MAX_BITS` ns (73 minutes) and more share the last bucket.
const MAX_BITS: u32 = 42;
const BUCKETS: usize = ((MAX_BITS - SPLIT_BITS + 1) as usize) << SPLIT_BITS;

/// A log-linear histogram of times in nanoseconds (as HdrHistogram), exact to 1 %, and exact below 64 ns, in 19 KiB.
#[derive(Clone, Debug)]
pub struct Histogram {
    counts: Box<[u64]>,
    samples: u64,
    max_ns: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: vec![0; BUCKETS].into_boxed_slice(), samples: 0, max_ns: 0 }
    }
}

impl Histogram {
    /// Adds one time.
    pub fn add(&mut self, time_ns: u64) {
        self.counts[bucket_index(time_ns)] += 1;
        self.samples += 1;
        self.max_ns = self.max_ns.max(time_ns);
    }

    /// Returns the number of times added.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Returns the exact maximum; 0 without samples.
    pub fn max_ns(&self) -> u64 {
        self.max_ns
    }

    /// Returns the percentile `p` (0 to 1) by nearest rank: the smallest time that at least this fraction of the
    /// samples does not exceed; 0 without samples.
    pub fn percentile_ns(&self, p: f64) -> u64 {
        let rank = ((p * self.samples as f64).ceil() as u64).clamp(1, self.samples.max(1));
        let mut cumulative = 0;
        for (index, &count) in self.counts.iter().enumerate() {
            cumulative += count;
            if cumulative >= rank {
                return bucket_middle_ns(index).min(self.max_ns);
            }
        }
        0
    }
}

/// Returns the bucket of `time_ns`.
fn bucket_index(time_ns: u64) -> usize {
    let time_ns = time_ns.min((1 << MAX_BITS) - 1);
    // Below SPLIT each bucket is a single nanosecond.
    let shift = (time_ns | SPLIT).ilog2() - SPLIT_BITS;
    ((time_ns >> shift) + (u64::from(shift) << SPLIT_BITS)) as usize
}

/// Returns the time in the middle of a bucket.
fn bucket_middle_ns(bucket: usize) -> u64 {
    let bucket = bucket as u64;
    let shift = (bucket >> SPLIT_BITS).saturating_sub(1);
    let first_ns = (bucket - (shift << SPLIT_BITS)) << shift;
    first_ns + (1 << shift) / 2
}

/// One histogram per pass of the blur, in the order in which the passes were first seen.
#[derive(Clone, Debug, Default)]
pub struct PassHistograms(Vec<(&'static str, Histogram)>);

impl PassHistograms {
    /// Adds one run of the pass `name`. Allocates only when a pass is seen for the first time.
    pub fn add(&mut self, name: &'static str, time_ns: u64) {
        let index = self.0.iter().position(|pass| pass.0 == name).unwrap_or_else(|| {
            self.0.push((name, Histogram::default()));
            self.0.len() - 1
        });
        self.0[index].1.add(time_ns);
    }

    /// Iterates over pass names and histograms.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &Histogram)> {
        self.0.iter().map(|(name, histogram)| (*name, histogram))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_time_reads_back_within_one_percent() {
        let mut time_ns = 1u64;
        let mut last_bucket = 0;
        while time_ns < 1 << MAX_BITS {
            let bucket = bucket_index(time_ns);
            assert!(bucket >= last_bucket && bucket < BUCKETS);
            last_bucket = bucket;
            let error = bucket_middle_ns(bucket).abs_diff(time_ns) as f64 / time_ns as f64;
            assert!(error <= 0.01 && (time_ns >= SPLIT || error == 0.0), "{time_ns} ns is off by {error}");
            time_ns += 1 + time_ns / 97;
        }
        assert_eq!(bucket_index(u64::MAX), BUCKETS - 1);
    }

    #[test]
    fn percentiles_are_nearest_rank() {
        let mut times = Histogram::default();
        assert_eq!((times.percentile_ns(0.5), times.max_ns()), (0, 0));
        for ms in (1..=1000u64).rev() {
            times.add(ms * 1_000_000);
        }
        for (p, ms) in [(0.5, 500.0), (0.95, 950.0), (0.99, 990.0), (1.0, 1000.0)] {
            let read_ms = times.percentile_ns(p) as f64 / 1e6;
            assert!((read_ms / ms - 1.0).abs() <= 0.01, "p{p}: {read_ms} ms");
        }
        assert_eq!((times.samples(), times.max_ns()), (1000, 1_000_000_000));
        times.add(u64::MAX);
        assert_eq!(times.max_ns(), u64::MAX, "the maximum is exact even beyond the buckets");
    }

    #[test]
    fn the_rank_is_the_nearest_and_no_higher() {
        let mut times = Histogram::default();
        (1..=20).rev().for_each(|ns| times.add(ns));
        let ranks = [(0.0, 1), (0.05, 1), (0.051, 2), (0.5, 10), (0.51, 11), (0.95, 19), (0.99, 20), (1.0, 20)];
        for (p, ns) in ranks {
            assert_eq!(times.percentile_ns(p), ns, "p{p}");
        }
    }

    #[test]
    fn passes_keep_their_order() {
        let mut passes = PassHistograms::default();
        for name in ["prepare", "rows", "prepare"] {
            passes.add(name, 10);
        }
        assert!(passes.iter().map(|(name, times)| (name, times.samples())).eq([("prepare", 2), ("rows", 1)]));
    }
}
