//! Adapts a look to the depth of a source, or rejects it.

use super::{DepthChoice, SourceError};
use crate::depth::focus::FocusRule;
use crate::look::{Effect, Look, SourceDepth, Strength};

/// Adapts a look to what is `known` of the depth of a source: without depth, `auto` becomes a uniform blur; in relative
/// depth, a focus from 0 to 1 is a place.
///
/// # Errors
/// The look needs depth that the source lacks, its lens needs a focus distance, or its focus is 0 m.
pub fn adapt_look(look: &Look, depth: &DepthChoice, known: SourceDepth) -> Result<Look, SourceError> {
    let has_depth = known.has_depth;
    let uses_depth = has_depth && *depth != DepthChoice::None;
    let lacks_metres = known.is_relative && uses_depth;
    if look.effect == Effect::Dof && !uses_depth {
        return SourceError::usage_error(match has_depth {
            true => "--effect dof needs depth: leave --depth none out, or use --effect blur or tilt-shift",
            false => "--effect dof needs depth, and the source has none: use --effect blur or tilt-shift",
        });
    }
    if *depth == DepthChoice::Recorded && !has_depth {
        return SourceError::usage_error("--depth recorded: the source has no depth");
    }
    if !lacks_metres && look.focus.for_depth(false).is_none() {
        return SourceError::usage_error(format!(
            "--focus {}: use METRES above 0; a place from 0 to 1 is for relative depth (--depth-unit inverse)",
            look.focus
        ));
    }
    // Without an effect by depth, focus and lens wait for one.
    let is_relative = lacks_metres && look.effect.follows_depth();
    let focus = look.focus;
    let look = look.for_source(SourceDepth { has_depth: uses_depth, is_relative, ..known });
    let look = if lacks_metres && !is_relative { Look { focus, ..look } } else { look };
    let has_distance = look.effect.follows_depth() || matches!(look.focus, FocusRule::Metres(_));
    if matches!(look.strength, Strength::Lens(_)) && !has_distance {
        return SourceError::usage_error(
            "a lens without depth needs --focus METRES: its blur depends on the distance of focus",
        );
    }
    Ok(look)
}

/// Rejects a look that needs real distances; `who` is the subject of the message, a source of relative depth. A focus
/// from 0 to 1 is a place in it.
///
/// # Errors
/// The look needs real distances.
pub fn reject_metric_look(look: &Look, who: &str) -> Result<(), SourceError> {
    let focus = look.focus.for_depth(true).unwrap_or(look.focus);
    match (Look { focus, ..look.clone() }).metric_setting() {
        None => Ok(()),
        Some(needs) => SourceError::usage_error(format!(
            "{needs} needs distances, and {who} only the order of depth: use --focus auto, X,Y or a place from 0 \
             (nearest) to 1, and --blur"
        )),
    }
}
