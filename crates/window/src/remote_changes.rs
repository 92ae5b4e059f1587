//! Temporary look changes from remote control: they last while the window is open and are never saved.

use bokehcam::look::{Look, Patch};

/// The user's own look, and the settings that remote control changed on top of it.
#[derive(Debug, Default)]
pub struct RemoteChanges(Option<(Look, Patch)>);

impl RemoteChanges {
    /// Records that remote control changed the look from `before` to `after`.
    pub fn record(&mut self, before: &Look, after: &Look) {
        let own = self.remove_from(before);
        let changed = Patch::from_look(after).without_equal_values(&Patch::from_look(&own));
        self.0 = Some((own, changed));
    }

    /// Returns `look` with the user's own values for the settings that still have their remotely set value.
    pub fn remove_from(&self, look: &Look) -> Look {
        let own = self
            .0
            .as_ref()
            .and_then(|(own, changed)| Patch::from_look(look).without_equal_values(changed).apply_to(own).ok());
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
        let mut remote = RemoteChanges::default();
        assert_eq!(remote.remove_from(&mine), mine);
        let patched = Look { rim: 0.5, highlights: 6.0, strength: Strength::Percent(3.0), ..mine.clone() };
        remote.record(&mine, &patched);
        assert_eq!(remote.remove_from(&patched), mine);
        // The user changes one remotely set setting, and one other.
        let turned = Look { rim: 0.9, focus_range_m: 1.0, ..patched };
        let kept = Look { rim: 0.9, focus_range_m: 1.0, ..mine };
        assert_eq!(remote.remove_from(&turned), kept);
        let more = Look { rim: 0.1, focus_range_m: 1.0, ..turned.clone() };
        remote.record(&turned, &more);
        assert_eq!(remote.remove_from(&more), kept);
    }
}
