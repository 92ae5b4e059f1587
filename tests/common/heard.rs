//! A session as the window has it: its updates so far, and the source of its frames.
#![allow(dead_code)]

use std::ops::{Deref, DerefMut};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bokehcam::depth::plate::Guide;
use bokehcam::link::Receiver;
use bokehcam::link::demand::{Demand, Watch};
use bokehcam::look::{Look, Strength};
use bokehcam_files::user_folders::Folders;
use bokehcam_live::capture::Seeker;
use bokehcam_live::pipeline::View;
use bokehcam_window::services::Services;
use bokehcam_window::session::{Session, SessionConfig, SessionEvent, Still};
use bokehcam_window::state::Update;

pub const PATIENCE: Duration = Duration::from_secs(120);

pub fn look() -> Look {
    Look { strength: Strength::AtInfinity(2.0), ..Look::default() }
}

pub struct Heard {
    pub session: Session,
    pub views: Option<Receiver<View>>,
    pub guide: Option<Arc<Guide>>,
    pub seeker: Option<Arc<Seeker>>,
    pub told: Vec<Update>,
    pub copied: Option<String>,
    /// Stills in other looks.
    pub blurred: Vec<Still>,
    /// Counts as a viewer while it is held.
    pub watch: Option<Watch>,
    pub demand: Demand,
}

/// A session, and the test's ends of its services.
pub struct Watched<T> {
    pub heard: Heard,
    pub services: T,
}

impl<T> Deref for Watched<T> {
    type Target = Heard;
    fn deref(&self) -> &Heard {
        &self.heard
    }
}

impl<T> DerefMut for Watched<T> {
    fn deref_mut(&mut self) -> &mut Heard {
        &mut self.heard
    }
}

impl Heard {
    pub fn begin(services: Box<dyn Services>, source: &str, folder: &Path) -> Self {
        let demand = Demand::default();
        let watch = Some(demand.watch());
        let config = SessionConfig {
            services,
            look: look(),
            source: source.into(),
            outputs: Vec::new(),
            keep_going: false,
            budget_ns: None,
            threads: 1,
            folders: Folders::single(folder.to_owned()),
            output_request: Arc::default(),
            demand: demand.clone(),
            off: Arc::default(),
        };
        let session = Session::start(config, Arc::new(|| {})).unwrap();
        let (told, blurred) = (Vec::new(), Vec::new());
        Self { session, views: None, guide: None, seeker: None, told, copied: None, blurred, watch, demand }
    }

    pub fn hear(&mut self) {
        while let Some(heard) = self.session.try_recv_event() {
            match heard {
                SessionEvent::Update(told) => self.told.push(told),
                SessionEvent::RunStarted(views, guide, seeker) => {
                    (self.views, self.guide, self.seeker) = (Some(views), guide, seeker);
                }
                SessionEvent::Copy(text) => self.copied = Some(text),
                SessionEvent::Reblurred(blurred) => self.blurred.push(*blurred),
            }
        }
    }

    /// Waits for an update that satisfies `is`; drops the earlier ones.
    #[track_caller]
    pub fn until(&mut self, what: &str, is: impl Fn(&Update) -> bool) -> Update {
        let began = Instant::now();
        loop {
            self.hear();
            if let Some(at) = self.told.iter().position(&is) {
                return self.told.drain(..=at).next_back().unwrap();
            }
            assert!(began.elapsed() < PATIENCE, "never heard: {what}; {:?}", self.told);
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Waits for a frame that satisfies `is`.
    #[track_caller]
    pub fn frame(&mut self, what: &str, is: impl Fn(&View) -> bool) -> View {
        let began = Instant::now();
        loop {
            self.hear();
            if let Some(view) = self.views.as_mut().and_then(Receiver::try_recv).filter(&is) {
                return view;
            }
            assert!(began.elapsed() < PATIENCE, "never seen: {what}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}
