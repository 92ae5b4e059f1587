//! Connected components of a binary mask, foreground and background, by runs (union-find).

use std::ops::Range;

/// Maximum number of predicates of [`Components::find`].
const MAX_PREDICATES: usize = 4;

/// A component, connected by sides (4-connected).
#[derive(Clone, Copy, Debug)]
pub struct Component {
    /// Parent in the union-find forest, or its own index.
    parent: u32,
    pub is_person: bool,
    /// Number of pixels.
    pub pixels: u32,
    /// Numbers of pixels that satisfy each predicate.
    pub matches: [u32; MAX_PREDICATES],
    /// Whether it touches the border of the picture.
    pub touches_border: bool,
}

/// Consecutive pixels of one kind in a row.
#[derive(Clone, Debug)]
struct Run {
    pixels: Range<usize>,
    component: u32,
}

/// Finds connected components; owns the memory for it.
#[derive(Debug, Default)]
pub struct Components {
    runs: Vec<Run>,
    components: Vec<Component>,
}

impl Components {
    /// Finds the components of a mask `width` pixels wide, and counts the pixels of each that satisfy each
    /// predicate.
    pub fn find<const N: usize>(&mut self, persons: &[bool], width: usize, predicates: impl Fn(usize) -> [bool; N]) {
        let Self { runs, components } = self;
        runs.clear();
        components.clear();
        let mut above = 0..0;
        for (y, row) in persons.chunks_exact(width.max(1)).enumerate() {
            let (began, mut start) = (runs.len(), y * width);
            for same in row.chunk_by(|a, b| a == b) {
                let pixels = start..start + same.len();
                start = pixels.end;
                let at_side = pixels.start.is_multiple_of(width) || pixels.end.is_multiple_of(width);
                let mut component = components.len() as u32;
                components.push(Component {
                    parent: component,
                    is_person: same[0],
                    pixels: same.len() as u32,
                    matches: pixels.clone().fold([0; MAX_PREDICATES], |mut counts, at| {
                        counts.iter_mut().zip(predicates(at)).for_each(|(count, is)| *count += u32::from(is));
                        counts
                    }),
                    touches_border: at_side || y == 0 || (y + 1) * width == persons.len(),
                });
                // Runs above that end before this one are irrelevant to all later ones.
                above.start +=
                    runs[above.clone()].iter().take_while(|run| run.pixels.end + width <= pixels.start).count();
                let beside = runs[above.clone()].iter().take_while(|run| run.pixels.start + width < pixels.end);
                for run in beside.filter(|run| persons[run.pixels.start] == same[0]) {
                    component = merge(components, component, run.component);
                }
                runs.push(Run { pixels, component });
            }
            above = began..runs.len();
        }
    }

    /// Iterates over all components.
    #[cfg(test)]
    fn iter_all(&self) -> impl Iterator<Item = &Component> {
        let roots = self.components.iter().enumerate().filter(|(at, component)| component.parent as usize == *at);
        roots.map(|(_, component)| component)
    }

    /// Iterates over all runs, with their components.
    pub fn runs(&self) -> impl Iterator<Item = (Range<usize>, &Component)> {
        self.runs.iter().map(|run| {
            let root = find_root(&self.components, run.component);
            (run.pixels.clone(), &self.components[root as usize])
        })
    }
}

fn add(a: [u32; MAX_PREDICATES], b: [u32; MAX_PREDICATES]) -> [u32; MAX_PREDICATES] {
    std::array::from_fn(|k| a[k] + b[k])
}

/// Returns the root of a component.
fn find_root(components: &[Component], mut component: u32) -> u32 {
    while components[component as usize].parent != component {
        component = components[component as usize].parent;
    }
    component
}

/// Merges two components and returns the root: the older one, so that chains stay short.
fn merge(components: &mut [Component], a: u32, b: u32) -> u32 {
    let (a, b) = (find_root(components, a), find_root(components, b));
    let (old, young) = (a.min(b), a.max(b));
    if old != young {
        let Component { pixels, matches, touches_border, .. } = components[young as usize];
        components[young as usize].parent = old;
        let all = &mut components[old as usize];
        (all.pixels, all.matches, all.touches_border) =
            (all.pixels + pixels, add(all.matches, matches), all.touches_border || touches_border);
    }
    old
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_connected_by_sides_and_holes_are_parts_of_their_own() {
        // A ring that is open below, a hole in a block, and a corner that only touches another.
        let picture = [
            "..........", //
            ".###..###.",
            ".#.#..#.#.",
            ".#.#..###.",
            "....##....",
            "....##....",
        ];
        let persons: Vec<bool> = picture.iter().flat_map(|row| row.bytes().map(|b| b == b'#')).collect();
        let mut components = Components::default();
        components.find(&persons, 10, |at| [at % 10 < 5]);
        let mut matches: Vec<_> = components
            .iter_all()
            .map(|part| (part.is_person, part.pixels, part.matches[0], part.touches_border))
            .collect();
        matches.sort_unstable();
        let background = persons.iter().filter(|is| !**is).count() as u32 - 1;
        let left = (0..60).filter(|at| at % 10 < 5 && !persons[*at]).count() as u32;
        assert_eq!(
            matches,
            [
                (false, 1, 0, false),
                (false, background, left, true),
                (true, 4, 2, true),
                (true, 7, 7, false),
                (true, 8, 0, false)
            ]
        );
        let covered: usize =
            components.runs().map(|(pixels, part)| pixels.filter(|&at| persons[at] == part.is_person).count()).sum();
        assert_eq!(covered, persons.len());
    }
}
