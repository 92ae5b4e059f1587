//! What others have changed of a window's look: it holds while the window is open, and is not remembered.

use bokehcam::look::{Look, Patch};

/// The person's own look beneath what others have changed.
#[derive(Debug, Default)]
pub struct Lent(Option<(Look, Patch)>);

impl Lent {
    /// Others changed the look from `before` to `after`.
    pub fn change(&mut self, before: &Look, after: &Look) {
        let own = self.without(before);
        let lent = Patch::of(after).beside(&Patch::of(&own));
        self.0 = Some((own, lent));
    }

    /// A look with the person's own settings where it still has those that others gave it.
    pub fn without(&self, look: &Look) -> Look {
        let own = self.0.as_ref().and_then(|(own, lent)| Patch::of(look).beside(lent).on(own).ok());
        own.unwrap_or_else(|| look.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bokehcam::look::Strength;
    use bokehcam::optics::Lens;

    #[test]
    fn what_others_changed_goes_and_what_the_person_changed_stays() {
        let lens = Lens { f_number: 2.0, focal_length_mm: 50.0, sensor_width_mm: 36.0 };
        let mine = Look { rim: 0.3, strength: Strength::Lens(lens), ..Look::default() };
        let mut lent = Lent::default();
        assert_eq!(lent.without(&mine), mine);
        let theirs = Look { rim: 0.5, highlights: 6.0, strength: Strength::Percent(3.0), ..mine.clone() };
        lent.change(&mine, &theirs);
        assert_eq!(lent.without(&theirs), mine);
        // The person turns one of those, and another setting.
        let turned = Look { rim: 0.9, focus_range_m: 1.0, ..theirs };
        let kept = Look { rim: 0.9, focus_range_m: 1.0, ..mine };
        assert_eq!(lent.without(&turned), kept);
        let more = Look { rim: 0.1, focus_range_m: 1.0, ..turned.clone() };
        lent.change(&turned, &more);
        assert_eq!(lent.without(&more), kept);
    }
}
