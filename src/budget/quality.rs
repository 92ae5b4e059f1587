//! The rungs of the quality ladder. A rung changes fidelity, never the amount of blur.

use std::fmt;
use std::str::FromStr;

/// A rung of the ladder, from cheapest to finest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum Quality {
    /// The floor: nothing is filled in behind near objects. A blur always stays, whatever the load.
    Draft,
    /// Two bins a side, two separable terms.
    Fast,
    /// The default.
    #[default]
    Balanced,
    /// More bins and terms.
    High,
    /// As good as this method gets, at several times the cost.
    Best,
}

impl Quality {
    /// All rungs, cheapest first.
    pub const ALL: [Quality; 5] = [Quality::Draft, Quality::Fast, Quality::Balanced, Quality::High, Quality::Best];

    /// The rung's name on the command line and in the report.
    pub fn name(self) -> &'static str {
        match self {
            Quality::Draft => "draft",
            Quality::Fast => "fast",
            Quality::Balanced => "balanced",
            Quality::High => "high",
            Quality::Best => "best",
        }
    }
}

impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Quality {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|q| q.name() == text).ok_or_else(|| {
            let names: Vec<_> = Self::ALL.iter().map(|q| q.name()).collect();
            format!("no quality level '{text}': use {}", names.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_is_read_by_the_name_it_is_written_with() {
        for quality in Quality::ALL {
            assert_eq!(quality.to_string().parse(), Ok(quality));
        }
        let refused = "finest".parse::<Quality>();
        assert_eq!(refused, Err("no quality level 'finest': use draft, fast, balanced, high, best".into()));
    }
}
