//! Looks of a session: applying new ones, and finding the one of a displayed frame.

use std::mem;
use std::str::FromStr;

use super::super::{SaveOptions, SessionEvent, Still, held};
use super::SessionWorker;
use bokehcam::engine::Images;
use bokehcam::look::{Look, Patch};
use bokehcam_files::user_folders as folders;
use bokehcam_live::control::Answer;
use bokehcam_live::source::{Kind, SourceName};
use bokehcam_media::recording::snapshot::{self, Snapshot};

/// Number of recent looks kept for snapshots: a frame in flight has one of the last few.
const MAX_KEPT_LOOKS: usize = 512;

impl SessionWorker {
    /// Blurs with another look from now on, and records it with its change number for snapshots.
    pub(super) fn switch_look(&mut self, look: Look) {
        self.config.look = look;
        let number = self.looks.back().map_or(0, |(last, _)| last + 1);
        let look = self.effective_look();
        self.looks.push_back((number, look.clone()));
        if self.looks.len() > MAX_KEPT_LOOKS {
            self.looks.pop_front();
        }
        // The held frame is on the screen, so it comes first.
        self.reblur_held();
        if let Some(pipeline) = &mut self.pipeline
            && let Err(line) = pipeline.switch_look(look, number, &mut *self.config.services)
        {
            self.events.note(line);
        }
    }

    /// Returns the look as far as the source supports it.
    pub(super) fn effective_look(&self) -> Look {
        self.pipeline
            .as_ref()
            .map_or_else(|| self.config.look.clone(), |pipeline| self.config.look.for_source(&pipeline.facts))
    }

    /// Blurs for a call while there is a virtual camera, or one `begins`.
    pub(super) fn follow_calls(&mut self, begins: bool) {
        let is_for_call = begins || self.outputs.has_virtual_camera();
        let is_changed = self
            .pipeline
            .as_mut()
            .is_some_and(|pipeline| mem::replace(&mut pipeline.facts.is_for_call, is_for_call) != is_for_call);
        if is_changed {
            self.switch_look(self.config.look.clone());
        }
    }

    /// Holds a frame on the screen.
    pub(super) fn hold_frame(&mut self, still: Still, is_outdated: bool) {
        self.held = Some(held::HeldBlur::new(still, self.config.look.focus));
        if is_outdated {
            self.reblur_held();
        }
    }

    /// Blurs the held frame with the latest look.
    fn reblur_held(&mut self) {
        if let (Some(held), Some((number, look))) = (&mut self.held, self.looks.back()) {
            match held.reblur(look, *number, self.config.threads, &mut *self.config.services) {
                Ok(blurred) => self.events.send(SessionEvent::Reblurred(Box::new(blurred))),
                Err(line) => self.events.note(line),
            }
        }
    }

    /// Saves a snapshot with the settings that reproduce it: those of the look that blurred the frame.
    pub(super) fn save_frame(&self, still: &Still, SaveOptions { with_sources, request }: &SaveOptions) {
        let its_look = self.looks.iter().rev().find(|(number, _)| *number <= still.change);
        let look = its_look.map_or(&self.config.look, |(_, look)| look);
        let settings = Patch::from_look(&look.for_saved_frame(&still.coc, still.quality)).values();
        let Images { color, depth, blurred: picture } = &still.images;
        let sources = with_sources.then_some((color, depth.as_ref()));
        let source = SourceName::from_str(&self.config.source).map_or(Kind::default(), |name| name.kind()).name();
        let snapshot = Snapshot { picture, sources, settings: &settings, source };
        let saved = match request.as_ref().and_then(|request| request.to.as_deref()) {
            Some(path) => snapshot::save_as(path, &snapshot).map(|()| path.to_owned()),
            None => snapshot::save(&self.config.folders.pictures, &folders::timestamped_stem(), &snapshot),
        };
        let answer = match saved {
            Ok(path) => {
                self.events.note(format!("Saved {}", folders::format_path(&path)));
                self.events.report_saved(&path);
                Ok(path)
            }
            Err(error) => {
                self.events.note(error.to_string());
                Err(Answer::failed(error.to_string()))
            }
        };
        // Fails if the caller has timed out; the note remains.
        request.iter().for_each(|request| drop(request.answer.try_send(answer.clone())));
    }
}
