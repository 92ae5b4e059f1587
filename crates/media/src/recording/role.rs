//! What a file, a layer or an array holds, by the words of its name: one vocabulary for all containers.

/// What numbers stand for. The order is that of preference where several could be a map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Role {
    Depth,
    /// Relative, and larger numbers are nearer.
    InverseDepth,
    Disparity,
    /// The name says nothing.
    #[default]
    Unstated,
    /// Pictures of infrared light.
    Infrared,
    /// What is measured beside depth: normals, positions, motion, confidence, masks, infrared.
    Other,
}

const OTHER: &str = "normal normals position positions motion velocity vector flow mist conf confidence certainty \
    uncertainty variance valid validity mask masks label labels";
const DISPARITY: &str = "disp disparity disparities";
const INVERSE: &str = "inv inverse invdepth idepth";
const DEPTH: &str = "depth depths depthmap zdepth z pz distance distances";
/// Yields to depth, which may be named after the camera that has its view.
const INFRARED: &str = "ir infra infrared";

impl Role {
    /// Returns the role that a name states, such as `ViewLayer.Denoising Depth` or `left_disp0`.
    pub fn of_name(name: &str) -> Self {
        let words: Vec<String> = words(name).collect();
        let has = |known: &str| known.split(' ').any(|known| words.iter().any(|word| word == known));
        // The confidence, mask or normal of depth is no depth.
        match () {
            () if has(OTHER) => Self::Other,
            () if has(DISPARITY) => Self::Disparity,
            () if has(INVERSE) => Self::InverseDepth,
            () if has(DEPTH) => Self::Depth,
            () if has(INFRARED) => Self::Infrared,
            () => Self::Unstated,
        }
    }

    /// Returns whether all words of a name state a role.
    pub fn is_name_only(name: &str) -> bool {
        words(name).all(|word| Self::of_name(&word) != Self::Unstated)
    }

    /// Returns the number of words of a name beside those that state its role: the fewer, the plainer.
    pub fn count_other_words(name: &str) -> usize {
        words(name).filter(|word| DEPTH.split(' ').all(|known| word != known)).count()
    }
}

/// Splits a name into its words in lower case: `VRayZDepth_02` is `v`, `ray`, `z`, `depth`.
fn words(name: &str) -> impl Iterator<Item = String> {
    let mut words = vec![String::new()];
    let letters: Vec<char> = name.chars().collect();
    for (at, &letter) in letters.iter().enumerate() {
        let next_is_lower = letters.get(at + 1).is_some_and(|next| next.is_lowercase());
        let before_is_lower = at > 0 && letters[at - 1].is_lowercase();
        if !letter.is_alphabetic() || letter.is_uppercase() && (next_is_lower || before_is_lower) {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut().filter(|_| letter.is_alphabetic()) {
            word.extend(letter.to_lowercase());
        }
    }
    words.into_iter().filter(|word| !word.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_a_name_say_what_it_holds() {
        for (name, role) in [
            ("Z", Role::Depth),
            ("ViewLayer.Depth", Role::Depth),
            ("VRayZDepth", Role::Depth),
            ("00000_depth", Role::Depth),
            ("depth_map", Role::Depth),
            ("disp0GT", Role::Disparity),
            ("left_disp", Role::Disparity),
            ("invDepth", Role::InverseDepth),
            ("inverse_depth", Role::InverseDepth),
            ("depth_confidence", Role::Other),
            ("depthNormals", Role::Other),
            ("00000_depth_mask", Role::Other),
            ("image_ir_rect", Role::Infrared),
            ("infra1", Role::Infrared),
            ("aligned_depth_to_infra1", Role::Depth),
            ("display", Role::Unstated),
            ("dispatcher_2", Role::Unstated),
            ("prediction", Role::Unstated),
            ("", Role::Unstated),
        ] {
            assert_eq!(Role::of_name(name), role, "{name}");
        }
    }
}
