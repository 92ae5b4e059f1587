//! Changes of a look, as far as a run can have them: one rule for the command line, remote control, the window and other
//! programs.

use std::error::Error;

use super::settings::LENS_SETTINGS;
use super::{Effect, Look, LookFacts, Metres, Patch, Strength, Value};
use crate::bokeh::BokehError;
use crate::depth::backdrop::Background;
use crate::depth::focus::FocusRule;

/// An error in the settings of a look.
#[derive(Debug, thiserror::Error)]
pub enum LookError {
    /// A lens lacks one of its numbers.
    #[error("a lens needs all of --f-number, --focal-length and --sensor-width")]
    Lens,
    /// The effect needs depth.
    #[error("{}", describe_lack_of_depth(*effect, *is_declined))]
    NoDepth {
        /// The effect.
        effect: Effect,
        /// Whether the source has depth that is declined.
        is_declined: bool,
    },
    /// A setting needs what the source does not have.
    #[error("{0}")]
    Unsuited(String),
    /// No executor can do it, or no output can hold the result.
    #[error(transparent)]
    Blur(#[from] BokehError),
    /// A picture cannot be read.
    #[error(transparent)]
    Picture(Box<dyn Error + Send + Sync>),
    /// A video behind the subject cannot be read.
    #[error("--behind: {0}")]
    Video(Box<dyn Error + Send + Sync>),
}

impl LookError {
    /// Returns whether the settings must be changed: the same ones would never succeed.
    pub fn is_wrong_argument(&self) -> bool {
        match self {
            Self::Lens | Self::NoDepth { .. } | Self::Unsuited(_) => true,
            Self::Blur(error) => matches!(error, BokehError::TooWide { .. } | BokehError::Transparent),
            Self::Picture(_) | Self::Video(_) => false,
        }
    }
}

fn describe_lack_of_depth(effect: Effect, is_declined: bool) -> String {
    let remedy = match is_declined {
        true => ": leave --depth none out, or",
        false => ", and the source has none:",
    };
    format!("--effect {effect} needs depth{remedy} use --effect blur or tilt-shift")
}

/// A requested change of a look; the default changes nothing.
#[derive(Clone, Debug, Default)]
pub struct Change {
    /// The settings.
    pub patch: Patch,
    /// Those of them that are asked for by themselves, and not as parts of a preset.
    pub asked: Patch,
}

impl Change {
    /// Returns a change to these settings.
    pub fn to_settings(patch: Patch) -> Self {
        Self { asked: patch.clone(), patch }
    }

    /// Returns a change to the preset of these settings.
    pub fn to_preset(patch: Patch) -> Self {
        Self { patch, asked: Patch::default() }
    }
}

impl Patch {
    /// Returns the settings in metres. In `relative` depth, a focus from 0 to 1 is a place, and not a distance.
    pub fn metric_settings(&self, relative: bool) -> Vec<Value> {
        let is_distance = |focus: FocusRule| match relative {
            true => focus.for_depth(true).is_none(),
            false => matches!(focus, FocusRule::Metres(_)),
        };
        let is_metric = |(name, _): &Value| match *name {
            "focus" => self.focus.is_some_and(is_distance),
            "focus-range" => self.focus_range_m.is_some_and(|range_m| range_m > 0.0),
            name => LENS_SETTINGS.contains(&name),
        };
        self.values().into_iter().filter(is_metric).collect()
    }
}

impl Look {
    /// Returns this look after a change, as far as a run with these `facts` can have it, and a line on what is left
    /// out. Without depth, an effect of `auto` that the look has already becomes a uniform blur. In relative depth,
    /// a focus from 0 to 1 is a place, and what a preset has in metres is left out.
    ///
    /// # Errors
    /// A lens lacks a number, a picture cannot be read, or the run cannot have what is asked for: an effect by depth, a
    /// setting in metres, transparency, or so large a radius.
    pub fn change(&self, change: &Change, facts: &LookFacts) -> Result<(Self, Option<String>), LookError> {
        let wanted = change.patch.apply_to(self)?;
        let follows_depth = wanted.effect.follows_depth();
        let becomes_uniform = wanted.effect == Effect::Auto && self.effect == Effect::Auto;
        if follows_depth && !facts.has_depth && !becomes_uniform {
            return Err(LookError::NoDepth { effect: wanted.effect, is_declined: facts.is_declined });
        }
        if wanted.background == Background::Transparent && !facts.keeps_alpha {
            return Err(BokehError::Transparent.into());
        }
        let is_relative = facts.has_depth && facts.metres == Metres::Missing;
        if !is_relative && facts.metres != Metres::Unknown && wanted.focus.for_depth(false).is_none() {
            return Err(LookError::Unsuited(format!(
                "--focus {}: use METRES above 0; a place from 0 to 1 is for relative depth (--depth-unit inverse)",
                wanted.focus
            )));
        }
        let left_out = if follows_depth { change.find_unknown_metres(&wanted, facts)? } else { Vec::new() };
        // Without an effect by depth, focus and lens wait for one.
        let metres = if is_relative && !follows_depth { Metres::Unknown } else { facts.metres };
        let mut look = wanted.for_source(&LookFacts { metres, ..*facts });
        if !left_out.is_empty() {
            look = look.without_metres(facts.size);
        }
        let has_distance = look.effect.follows_depth() || matches!(look.focus, FocusRule::Metres(_));
        if matches!(look.strength, Strength::Lens(_)) && !has_distance {
            return Err(LookError::Unsuited(
                "a lens without depth needs --focus METRES: its blur depends on the distance of focus".to_owned(),
            ));
        }
        if facts.size != (0, 0) {
            look.blur_settings(facts.size, false).map_or(Ok(()), |settings| settings.check(facts.size))?;
        }
        Ok((look, describe_left_out(&left_out)))
    }
}

impl Change {
    /// Returns the settings in metres of the `wanted` look that a source with depth does not have: with an assumed
    /// geometry, those of this change alone.
    ///
    /// # Errors
    /// One of them is asked for by itself.
    fn find_unknown_metres(&self, wanted: &Look, facts: &LookFacts) -> Result<Vec<Value>, LookError> {
        let (relative, instead) = match facts.metres {
            Metres::Missing if facts.has_depth => (
                true,
                "and this depth gives only their order: use --focus auto, X,Y or a place from 0 (nearest) to 1, and \
                 --blur",
            ),
            Metres::Assumed if facts.has_depth => (
                false,
                "which this stereo pair does not give: add --calib FILE, or --focal-px and --baseline-m; or use --focus \
                 auto or X,Y, and --blur",
            ),
            _ => return Ok(Vec::new()),
        };
        match self.asked.metric_settings(relative).first() {
            Some((name, value)) => Err(LookError::Unsuited(format!("--{name} {value} needs distances, {instead}"))),
            None if relative => Ok(Patch::from_look(wanted).metric_settings(true)),
            None => Ok(self.patch.metric_settings(false)),
        }
    }
}

fn describe_left_out(settings: &[Value]) -> Option<String> {
    let flags: Vec<String> = settings.iter().map(|(name, value)| format!("--{name} {value}")).collect();
    let line = format!("without effect here: {} (distances in metres are unknown)", flags.join(", "));
    (!flags.is_empty()).then_some(line)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::look::presets::built_in_presets;

    const SIZE: (u32, u32) = (640, 480);

    fn patch(settings: &[(&str, &str)]) -> Patch {
        Patch::parse(settings.iter().copied()).unwrap()
    }

    fn facts(metres: Metres) -> LookFacts {
        LookFacts { has_depth: true, metres, size: SIZE, ..LookFacts::default() }
    }

    fn preset(name: &str) -> Change {
        Change::to_preset(built_in_presets().find(|preset| preset.name == name).unwrap().patch)
    }

    #[test]
    fn a_preset_lacks_metres_where_the_source_does_and_a_setting_is_refused() {
        let set = |settings: &[(&str, &str)], metres| {
            Look::default().change(&Change::to_settings(patch(settings)), &facts(metres)).map_err(|e| e.to_string())
        };
        for metres in [Metres::Missing, Metres::Assumed] {
            let (look, note) = Look::default().change(&preset("product"), &facts(metres)).unwrap();
            assert!(look.strength == Strength::Percent(1.6) && !look.needs_metres(), "{look:?}");
            assert_eq!(note.unwrap(), "without effect here: --focus-range 0.3 (distances in metres are unknown)");
            let lens = [("f-number", "2"), ("focal-length", "50"), ("sensor-width", "36")];
            let (by_lens, note) = Look::default().change(&Change::to_preset(patch(&lens)), &facts(metres)).unwrap();
            assert!(!by_lens.needs_metres() && note.unwrap().contains("--f-number 2"), "{by_lens:?}");
            for (asked, flag) in [
                (&[("focus", "1.5")][..], "--focus 1.5 needs distances"),
                (&[("focus-range", "0.3")], "--focus-range 0.3 needs distances"),
                (&lens, "--f-number 2 needs distances"),
            ] {
                assert!(set(asked, metres).unwrap_err().starts_with(flag));
            }
            // One that is asked for beside a preset is no part of it.
            let both = Change { asked: patch(&[("focus", "1.5")]), ..preset("product") };
            assert!(Look::default().change(&both, &facts(metres)).is_err());
        }
        for metres in [Metres::Known, Metres::Unknown] {
            let (look, note) = Look::default().change(&preset("product"), &facts(metres)).unwrap();
            assert_eq!((look.focus_range_m, note), (0.3, None));
            assert_eq!(set(&[("focus", "1.5")], metres).unwrap().0.focus, FocusRule::Metres(1.5));
        }
        assert_eq!(set(&[("focus", "0.5")], Metres::Missing).unwrap().0.focus, FocusRule::Relative(0.5));
        assert!(set(&[("focus", "0.5")], Metres::Assumed).is_err());
        assert!(set(&[("focus", "0")], Metres::Known).unwrap_err().contains("METRES above 0"));
        assert_eq!(set(&[("focus", "0")], Metres::Unknown).unwrap().0.focus, FocusRule::Relative(0.0), "it waits");
        // A setting of an earlier change is not refused.
        let waiting = set(&[("effect", "blur"), ("focus", "1.5")], Metres::Missing).unwrap().0;
        assert_eq!(waiting.focus, FocusRule::Metres(1.5));
        let by_depth = Change::to_settings(patch(&[("effect", "dof")]));
        let (_, note) = waiting.change(&by_depth, &facts(Metres::Missing)).unwrap();
        assert!(note.unwrap().contains("--focus 1.5"));
    }

    #[test]
    fn an_effect_by_depth_is_refused_without_depth_unless_it_is_that_of_the_start() {
        let none = LookFacts { metres: Metres::Known, size: SIZE, ..LookFacts::default() };
        let start = Look::default().change(&Change::default(), &none).unwrap().0;
        assert_eq!(start.effect, Effect::Blur);
        let refused = start.change(&preset("dreamy"), &none).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "--effect auto needs depth, and the source has none: use --effect blur or tilt-shift"
        );
        let declined = LookFacts { is_declined: true, ..none };
        let dof = Change::to_settings(patch(&[("effect", "dof")]));
        assert!(Look::default().change(&dof, &declined).unwrap_err().to_string().contains("--depth none"));
        assert_eq!(start.change(&preset("miniature"), &none).unwrap().0.effect, Effect::TiltShift);
    }

    #[test]
    fn nothing_is_behind_only_where_outputs_hold_it() {
        for change in [Change::to_settings, Change::to_preset] {
            let change = change(patch(&[("behind", "transparent")]));
            let refused = Look::default().change(&change, &facts(Metres::Known)).unwrap_err();
            assert!(refused.is_wrong_argument() && refused.to_string().contains("FILE.webm"), "{refused}");
            let holding = LookFacts { keeps_alpha: true, ..facts(Metres::Known) };
            assert_eq!(Look::default().change(&change, &holding).unwrap().0.background, Background::Transparent);
        }
    }
}
