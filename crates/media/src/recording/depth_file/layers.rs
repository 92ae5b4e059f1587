//! Chooses the layer of an OpenEXR that means depth, by the names of its channels.

use exr::meta::header::Header;

use crate::recording::role::Role;

/// Most channels among which depth is searched; renderers write some dozens.
const MAX_CHANNELS: usize = 1024;

/// The layer and the channel with depth.
pub(super) struct Choice {
    pub layer: usize,
    /// What its name states.
    pub role: Role,
    /// The channel, and others that must be equal to it.
    pub channels: Vec<usize>,
    /// What was chosen of several.
    pub note: Option<String>,
}

/// A channel that may be depth.
struct Candidate<'a> {
    layer: usize,
    channel: usize,
    header: &'a Header,
    /// The layer within the picture, and the name there: `ViewLayer.Depth` and `Z`.
    prefix: String,
    last: String,
    /// The name there in capitals, to compare it with those of axes and colours.
    letter: String,
}

/// Chooses by meaning: a scalar whose name or layer says depth, above all the standard's `Z` and then the plainest name;
/// else a scalar that is grey, or else colours, which are depth if they are equal. A channel with others of its vector (the
/// z of a normal) is no scalar. `None` if there is no such channel, or there are too many to tell.
pub(super) fn choose(headers: &[Header]) -> Option<Choice> {
    let count: usize = headers.iter().map(|header| header.channels.list.len()).sum();
    let layers = headers.iter().enumerate().filter(|(_, header)| !header.deep && count <= MAX_CHANNELS);
    let candidates = layers.flat_map(|(layer, header)| {
        (0..header.channels.list.len()).map(move |channel| Candidate::new(layer, channel, header))
    });
    let mut ranked: Vec<_> = candidates.filter_map(|candidate| Some((candidate.rank()?, candidate))).collect();
    // Stable: of equals, the first.
    ranked.sort_by_key(|(rank, _)| *rank);
    let (best, chosen) = ranked.first()?;
    let equals = ranked.iter().filter(|(rank, _)| rank == best).count();
    let name = format!("{} {}.{}", chosen.part(), chosen.prefix, chosen.last);
    let name = name.trim_matches([' ', '.']);
    Some(Choice {
        layer: chosen.layer,
        role: chosen.role(),
        channels: [vec![chosen.channel], chosen.colors_beside()].concat(),
        note: (equals > 1)
            .then(|| format!("has {equals} layers that may be the depth, of which {name} is taken, the first")),
    })
}

impl<'a> Candidate<'a> {
    fn new(layer: usize, channel: usize, header: &'a Header) -> Self {
        let name = header.channels.list[channel].name.to_string();
        let (prefix, last) = name.rsplit_once('.').unwrap_or(("", &name));
        Self {
            layer,
            channel,
            header,
            prefix: prefix.to_owned(),
            last: last.to_owned(),
            letter: last.to_ascii_uppercase(),
        }
    }

    /// Returns the name of its part in a file of several.
    fn part(&self) -> String {
        self.header.own_attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default()
    }

    /// Returns what its layer is by name, or else the channel.
    fn role(&self) -> Role {
        match Role::of_name(&format!("{} {}", self.part(), self.prefix)) {
            Role::Unstated => Role::of_name(&self.last),
            stated => stated,
        }
    }

    /// Returns its place in the order of preference; `None` if it is no depth.
    fn rank(&self) -> Option<usize> {
        let role = self.role();
        let is_standard = self.letter == "Z" && self.prefix.is_empty() && self.part().is_empty();
        match role {
            _ if self.is_of_vector() || matches!(&*self.letter, "G" | "B" | "A") => None,
            Role::Depth if is_standard => Some(0),
            Role::Depth => Some(1 + Role::count_other_words(&self.prefix).min(7)),
            Role::Disparity | Role::InverseDepth => Some(9),
            Role::Unstated if ["Z", "V", "Y", "X"].contains(&&*self.letter) => Some(10),
            Role::Unstated if self.letter == "R" => Some(11),
            _ => None,
        }
    }

    fn is_of_vector(&self) -> bool {
        ["X", "Y", "Z"].contains(&&*self.letter) && self.all_beside(&["X", "Y"]).is_some()
    }

    /// Returns the channels G and B beside a channel R; empty unless both are there.
    fn colors_beside(&self) -> Vec<usize> {
        if self.letter == "R" { self.all_beside(&["G", "B"]).unwrap_or_default() } else { Vec::new() }
    }

    /// Returns the channels of these names in the same layer, if all are there.
    fn all_beside(&self, names: &[&str]) -> Option<Vec<usize>> {
        let find = |name: &&str| {
            let full = if self.prefix.is_empty() { (*name).to_owned() } else { format!("{}.{name}", self.prefix) };
            self.header.channels.list.iter().position(|channel| channel.name.to_string().eq_ignore_ascii_case(&full))
        };
        names.iter().map(find).collect()
    }
}
