//! Times in lists: decimal seconds, converted to nanoseconds without `f64`, which has only 53 bits for the 61 of
//! today's date.

use std::fmt;

const NS_PER_S: u64 = 1_000_000_000;

/// Parses a decimal number of seconds >= 0 to nanoseconds; digits beyond the ninth decimal are truncated.
pub(super) fn parse_ns(text: &str) -> Option<u64> {
    let (seconds, decimals) = text.split_once('.').unwrap_or((text, ""));
    let digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    // `parse` alone would accept a sign.
    if !(digits(seconds) && digits(decimals)) || (seconds.is_empty() && decimals.is_empty()) {
        return None;
    }
    let seconds: u64 = if seconds.is_empty() { 0 } else { seconds.parse().ok()? };
    let fraction_ns =
        decimals.bytes().chain(std::iter::repeat(b'0')).take(9).fold(0, |ns, digit| ns * 10 + u64::from(digit - b'0'));
    seconds.checked_mul(NS_PER_S)?.checked_add(fraction_ns)
}

/// Formats nanoseconds as exact decimal seconds.
pub(super) struct Seconds(pub(super) u64);

impl fmt::Display for Seconds {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}.{:09}", self.0 / NS_PER_S, self.0 % NS_PER_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_nanosecond_survives() {
        for ns in [0, 1, 999_999_999, 1_305_031_102_175_304_001, u64::MAX] {
            assert_eq!(parse_ns(&Seconds(ns).to_string()), Some(ns));
        }
        assert_eq!(parse_ns("1305031102.175304"), Some(1_305_031_102_175_304_000));
        assert_eq!(parse_ns("7"), Some(7 * NS_PER_S));
        assert_eq!(parse_ns("7."), Some(7 * NS_PER_S));
        assert_eq!(parse_ns(".5"), Some(NS_PER_S / 2));
        assert_eq!(parse_ns("0.0333333333999"), Some(33_333_333));
    }

    #[test]
    fn everything_else_is_refused() {
        for text in ["", ".", "nan", "inf", "-1.0", "+1.0", "1e9", "1.-5", "1.2.3", "0x10", "18446744074", "²"] {
            assert_eq!(parse_ns(text), None, "{text:?}");
        }
    }
}
