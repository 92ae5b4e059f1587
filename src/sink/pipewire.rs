//! A virtual camera of PipeWire's: what call programs of the session list as a camera, without a kernel module.
//!
//! Pictures go to the node's thread as YUYV, by a slot in which the newest wins, and are copied there to the readers'
//! memory. While nobody watches they stay here. The node shows a still card until the first one comes, and again once
//! nobody watches.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use super::rate::frame_rate;
use super::{Counter, Options, Sink, SinkError, card, check_size, yuyv};
use crate::frame::fit::Fit;
use crate::frame::{ColorImage, YuyvImage};
use crate::link::demand::{Demand, Watch};
use crate::link::pool::{Pool, Pooled};
use crate::link::{self, Receiver, Sender};
use crate::pipewire::node::{Node, Settings, Show};
use crate::stats::NodeUse;

/// What a camera is called that was given no name.
const NAME: &str = "bokehcam";
/// The shortest and the longest time after which a reader is given the last picture again.
const HOLD: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(1));
/// Pictures that are under way at most: one being made, one that waits, and two with the node, as it takes the next one
/// before it lets go of the last.
const PICTURES: usize = 4;

/// A camera that is given to PipeWire.
pub struct PipeWire {
    node: Node,
    label: String,
    size: (u32, u32),
    to: Sender<Frame>,
    pictures: Pool<YuyvImage>,
    /// Whether the pictures of the run have its size.
    wants_yuyv: bool,
    encoder: yuyv::Encoder,
    fit: Fit,
    fitted: ColorImage,
    is_watched: Arc<AtomicBool>,
    captured_ns: u64,
}

/// A picture on its way to the node.
struct Frame {
    picture: Pooled<YuyvImage>,
    /// By the system's monotonic clock.
    captured_ns: u64,
}

impl PipeWire {
    /// Gives PipeWire a camera that people see as `label` (`None`: bokehcam), with a still card until the first picture
    /// comes. With a demand in the options, that is told whether somebody watches.
    ///
    /// # Errors
    /// PipeWire cannot be reached, or refuses.
    pub fn open(label: Option<&str>, options: &Options) -> Result<Self, SinkError> {
        let (width, height) = options.out_size.unwrap_or(options.size);
        // Two pixels share their colour, and readers halve the height as well.
        let size = ((width & !1).max(2), (height & !1).max(2));
        let (rate, scale) = frame_rate(options.period_ns);
        let saturated = |number: u64| u32::try_from(number).unwrap_or(u32::MAX);
        let label = label.unwrap_or(NAME).to_owned();
        let settings = Settings {
            name: node_name(&label),
            label: label.clone(),
            size,
            rate: (saturated(rate), saturated(scale)),
            hold: (2 * Duration::from_nanos(options.period_ns)).clamp(HOLD.0, HOLD.1),
        };
        let (to, from) = link::live();
        let is_watched = Arc::new(AtomicBool::new(false));
        let (mut fitted, encoder) = (ColorImage::new(size.0, size.1), yuyv::Encoder::new());
        card::draw(&mut fitted);
        let blank = || YuyvImage::new(size.0, size.1);
        let mut card = blank();
        encoder.encode(&fitted, &mut card.bytes);
        let screen = Screen {
            from,
            frame: None,
            is_new: false,
            card,
            demand: options.demand.clone(),
            watch: None,
            is_watched: Arc::clone(&is_watched),
        };
        Ok(Self {
            node: Node::new(settings, screen)?,
            label,
            size,
            to,
            pictures: Pool::new(PICTURES, blank),
            wants_yuyv: size == options.size,
            encoder,
            fit: Fit::default(),
            fitted,
            is_watched,
            captured_ns: 0,
        })
    }
}

fn count(counter: &AtomicU64, pictures: u64) {
    counter.fetch_add(pictures, Ordering::Relaxed);
}

/// The name that programs remember a camera by: small letters and digits, and dashes for what is between them.
fn node_name(label: &str) -> String {
    let words = label.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    let name = words.map(str::to_lowercase).collect::<Vec<_>>().join("-");
    if name.is_empty() { NAME.to_owned() } else { name }
}

impl PipeWire {
    /// Sends the node a picture, which `make` makes where it is for somebody.
    fn send(&mut self, make: impl FnOnce(&mut Self, &mut YuyvImage)) -> ControlFlow<()> {
        if !self.is_watched.load(Ordering::Relaxed) {
            count(&self.node.counts().unwatched, 1);
            return ControlFlow::Continue(());
        }
        let Some(mut picture) = self.pictures.try_take() else {
            count(&self.node.counts().overtaken, 1);
            return ControlFlow::Continue(());
        };
        make(self, &mut picture);
        match self.to.send(Frame { picture, captured_ns: self.captured_ns }) {
            Ok(overtaken) => count(&self.node.counts().overtaken, overtaken.is_some().into()),
            // The node's thread has panicked, which was printed.
            Err(link::Abandoned) => return ControlFlow::Break(()),
        }
        self.node.wake();
        ControlFlow::Continue(())
    }
}

impl Sink for PipeWire {
    fn captured(&mut self, captured_ns: u64) {
        self.captured_ns = captured_ns;
    }

    fn put(&mut self, frame: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        Ok(self.send(|camera, picture| {
            camera.encoder.encode(camera.fit.fitted(frame, &mut camera.fitted), &mut picture.bytes);
        }))
    }

    fn wants_yuyv(&mut self) -> bool {
        self.wants_yuyv
    }

    fn put_yuyv(&mut self, frame: &mut YuyvImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        check_size(self.size, frame.size())?;
        Ok(self.send(|_, picture| std::mem::swap(picture, frame)))
    }

    fn is_live(&self) -> bool {
        true
    }

    fn nodes(&self) -> Vec<Counter<NodeUse>> {
        let (node, counts) = (self.node.name().to_owned(), Arc::clone(self.node.counts()));
        let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        vec![Arc::new(move || NodeUse {
            node: node.clone(),
            shown: of(&counts.shown),
            repeats: of(&counts.repeats),
            unwatched: of(&counts.unwatched),
            overtaken: of(&counts.overtaken),
            no_buffer: of(&counts.no_buffer),
            returns: of(&counts.returns),
        })]
    }

    fn describe(&self) -> String {
        let (width, height) = self.size;
        format!("PipeWire camera {} ({}), YUY2 {width}x{height}", self.node.name(), self.label)
    }
}

/// What the node shows, on its thread.
struct Screen {
    from: Receiver<Frame>,
    /// The picture that came last, while somebody watches.
    frame: Option<Frame>,
    /// Whether that was not drawn yet.
    is_new: bool,
    /// Shown while there is none.
    card: YuyvImage,
    demand: Option<Demand>,
    watch: Option<Watch>,
    is_watched: Arc<AtomicBool>,
}

impl Show for Screen {
    fn update(&mut self) -> bool {
        let Some(frame) = self.from.try_recv() else { return false };
        // What comes when the last reader has just left is for nobody.
        self.is_new = self.is_watched.load(Ordering::Relaxed);
        self.frame = self.is_new.then_some(frame);
        true
    }

    fn draw(&mut self, bytes: &mut [u8]) -> Option<u64> {
        let picture = self.frame.as_ref().map_or(&self.card, |frame| &frame.picture);
        bytes.copy_from_slice(&picture.bytes);
        let is_new = std::mem::take(&mut self.is_new);
        self.frame.as_ref().filter(|_| is_new).map(|frame| frame.captured_ns)
    }

    fn watched(&mut self, is_watched: bool) {
        self.is_watched.store(is_watched, Ordering::Relaxed);
        self.watch = self.demand.as_ref().filter(|_| is_watched).map(Demand::watch);
        if !is_watched {
            // The next reader is not to see what the last one saw.
            (self.frame, self.is_new) = (None, false);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_is_remembered_by_a_plain_name() {
        assert_eq!(node_name("bokehcam"), "bokehcam");
        assert_eq!(node_name(" Desk: left (2) "), "desk-left-2");
        assert_eq!(node_name("Büro"), "büro");
        assert_eq!(node_name("!?"), NAME);
    }
}
