//! Depth from a separate depth camera next to the colour camera.
//!
//! The newest maps are kept and paired with the colour frames by capture time. When the camera stops, the whole picture
//! is blurred: by an old map, the room would be sharp where the person was. The loss of depth is logged once, and so is
//! its return. Before the first map, and after a pause, there is no map, and frames are not shown.

mod pairing;
mod units;

use std::time::Duration;

pub use units::Units;

use crate::layout::Content;
use crate::v4l2::live::{LiveDevice, ModeRequest, Next, OpenError};
use bokehcam::calibration::registration::AnySizeRegistration;
use bokehcam::clock::Clock;
use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::DepthMap;
use pairing::Pairing;

/// Divisor of the depth period: how long a frame waits for a better matching map.
const WAIT_DIVISOR: u32 = 4;

/// Maximum number of polls in a row: a driver that never runs dry must not delay a frame.
const MAX_POLLS: usize = 8;

/// A depth camera with its conversion, registration and pairing.
pub struct LiveDepth {
    live: LiveDevice,
    units: Units,
    registration: Option<AnySizeRegistration>,
    pairing: Pairing,
    clock: Clock,
    /// Whether the loss of depth was logged, but not its return.
    is_stale: bool,
}

impl LiveDepth {
    /// Opens the depth camera `name`. Without a registration its view is assumed to be that of the colour camera.
    ///
    /// # Errors
    /// Fails if the camera does not exist, is busy, or does not deliver depth.
    pub fn open(
        name: &str,
        units: Units,
        registration: Option<AnySizeRegistration>,
        clock: Clock,
    ) -> Result<Self, OpenError> {
        let live = LiveDevice::open(name, ModeRequest::for_content(Content::Depth), Vec::new(), clock.clone())?;
        if registration.is_none() {
            tracing::info!(
                "{}: assumed to see the same as the colour camera; if it does not, give --depth-calibration",
                live.name()
            );
        }
        Ok(Self { live, units, registration, pairing: Pairing::default(), clock, is_stale: false })
    }

    /// Decodes the maps that the camera has ready into `pairing`; waits up to `timeout` for the first of them.
    fn receive_maps(&mut self, mut timeout: Duration) {
        for _ in 0..MAX_POLLS {
            match self.live.next(timeout) {
                Next::Frame { captured_ns } => {
                    let (layout, planes) = (*self.live.layout(), self.live.planes());
                    if let Some(plane) = planes.and_then(|planes| planes.first().copied()) {
                        let map = self.pairing.oldest_mut();
                        if self.units.decode(&layout, plane, map) {
                            self.pairing.commit(captured_ns);
                        }
                    }
                    self.live.release_frame();
                    timeout = Duration::ZERO;
                }
                Next::Lost(_) => {}
                Next::Waiting => return,
            }
        }
    }
}

impl DepthSource for LiveDepth {
    fn read(&mut self, FrameInput { stamp, color, .. }: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        self.receive_maps(Duration::ZERO);
        // Colour frames without a capture time get the newest map.
        let captured_ns = stamp.captured_ns.unwrap_or_else(|| self.clock.now_ns());
        let period_ns = self.live.negotiated().interval.period_ns();
        if self.pairing.is_worth_waiting(captured_ns, period_ns) {
            self.receive_maps(Duration::from_nanos(period_ns) / WAIT_DIVISOR);
        }
        let Self { live, pairing, is_stale, .. } = self;
        if pairing.newest_ns().is_none() {
            return Err(DepthError::Unpaired { source_name: live.name().to_owned() });
        }
        let nearest = pairing.nearest(captured_ns, period_ns);
        if std::mem::replace(is_stale, nearest.is_none()) != nearest.is_none() {
            match nearest {
                None => tracing::warn!("{}: no depth, so everything is blurred", live.name()),
                Some(_) => tracing::info!("{}: depth again", live.name()),
            }
        }
        let Some(nearest) = nearest else {
            map.fill_far(color.size());
            return Ok(());
        };
        map.subject_m = None;
        match &mut self.registration {
            Some(registration) => registration.register(nearest, map),
            None => {
                map.resize(nearest.width, nearest.height);
                map.metres.copy_from_slice(&nearest.metres);
            }
        }
        Ok(())
    }

    fn suspend(&mut self) {
        self.live.suspend();
        // The scene may be different afterwards, so that an old map would be wrong.
        self.pairing.clear();
        self.is_stale = false;
    }
}
