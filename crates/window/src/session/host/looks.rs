//! The looks of a session: those to come, and those that frames on the screen are of.

use super::super::{Saving, SessionEvent, Still, held};
use super::Host;
use bokehcam::control::Answer;
use bokehcam::engine::Images;
use bokehcam::files::user_folders as folders;
use bokehcam::look::{Look, Patch};
use bokehcam::recording::snapshot::{self, Snapshot};
use bokehcam::recording::still::write_color;

/// Looks that are kept for snapshots: frames that come are of one of the last few.
const KEPT_LOOKS: usize = 512;

impl Host {
    /// Blurs with another look from now on, and remembers it by its number for snapshots.
    pub(super) fn adopt(&mut self, look: Look) {
        self.start.look = look;
        let number = self.looks.back().map_or(0, |(last, _)| last + 1);
        let look = self.effective_look();
        self.looks.push_back((number, look.clone()));
        if self.looks.len() > KEPT_LOOKS {
            self.looks.pop_front();
        }
        // What is on the screen comes first.
        self.blur_held();
        if let Some(live) = &mut self.live
            && let Err(line) = live.adopt(look, number, &mut *self.start.services)
        {
            self.news.note(line);
        }
    }

    /// The look as far as the source allows it.
    pub(super) fn effective_look(&self) -> Look {
        self.live.as_ref().map_or_else(|| self.start.look.clone(), |live| live.effective(&self.start.look))
    }

    /// Keeps the frame that stays from now on.
    pub(super) fn hold(&mut self, still: Still, is_behind: bool) {
        self.held = Some(held::HeldBlur::new(still, self.start.look.focus));
        if is_behind {
            self.blur_held();
        }
    }

    /// Blurs the frame that stays as the last look says.
    fn blur_held(&mut self) {
        if let (Some(held), Some((number, look))) = (&mut self.held, self.looks.back()) {
            match held.blur(look, *number, &mut *self.start.services) {
                Ok(blurred) => self.news.send(SessionEvent::Blurred(Box::new(blurred))),
                Err(line) => self.news.note(line),
            }
        }
    }

    /// Saves a snapshot with the settings that repeat it: those of the look that its frame was blurred with.
    pub(super) fn save(&self, still: &Still, Saving { with_sources, order }: &Saving) {
        let its_look = self.looks.iter().rev().find(|(number, _)| *number <= still.change);
        let look = its_look.map_or(&self.start.look, |(_, look)| look);
        let settings = Patch::of(&look.of_frame(&still.coc, still.quality)).values();
        let Images { color, depth, blurred: picture } = &still.images;
        let sources = with_sources.then_some((color, depth.as_ref()));
        let snapshot = Snapshot { picture, sources, settings: &settings };
        let saved = match order.as_ref().and_then(|order| order.to.as_deref()) {
            Some(path) => {
                // If that fails, writing says why.
                let _ = path.parent().map(std::fs::create_dir_all);
                write_color(path, picture, false).map(|()| path.to_owned())
            }
            None => snapshot::save(&self.start.folders.pictures, &folders::stem(), &snapshot),
        };
        let answer = match saved {
            Ok(path) => {
                self.news.note(format!("Saved {}", folders::shown(&path)));
                self.news.kept(&path);
                Ok(path)
            }
            Err(error) => {
                self.news.note(error.to_string());
                Err(Answer::failed(error.to_string()))
            }
        };
        // Who gave up waiting sees the note.
        order.iter().for_each(|order| drop(order.answer.try_send(answer.clone())));
    }
}
