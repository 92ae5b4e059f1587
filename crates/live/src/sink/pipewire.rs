//! A PipeWire virtual camera, which the session's call programs list without a kernel module; or a filter that replaces
//! a real camera for the programs that request it.
//!
//! Pictures go to the node's thread in the readers' format, through a slot in which the newest wins, and are copied
//! there to the readers' memory. While no client watches, they are dropped here. The node shows a still card until the
//! first picture, and again while no client watches.

mod encoder;

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use encoder::{Encoder, Format, writable_modes};

use super::rate::frame_rate;
use super::{Counter, Options, Sink, SinkError, card, check_size};
use crate::pipewire::PipeWireError;
use crate::pipewire::graph::Graph;
use crate::pipewire::mode::{Mode, NegotiatedFormat};
use crate::pipewire::node::{DrawnPicture, Node, PictureMemory, PictureSource, Settings};
use crate::stats::NodeCounts;
use bokehcam::frame::{ColorImage, YuyvImage};
use bokehcam::link::demand::{Demand, Watch};
use bokehcam::link::pool::{Pool, Pooled};
use bokehcam::link::{self, Receiver, Sender};

/// Default name of a camera.
const DEFAULT_NAME: &str = "bokehcam";
/// Shortest and longest time after which the last picture is repeated for readers.
const REPEAT_INTERVAL: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(1));
/// Maximum number of pictures in flight: one being made, one waiting, and two with the node, which receives the next
/// one before it releases the last.
const MAX_IN_FLIGHT: usize = 4;

/// A camera provided to PipeWire.
pub struct PipeWire {
    node: Node,
    description: String,
    /// Size of the run's pictures.
    size: (u32, u32),
    sender: Sender<Frame>,
    pictures: Pool<Picture>,
    /// The readers' negotiated format, packed.
    format: Arc<AtomicU64>,
    /// Encoder for the format that was negotiated when the last picture came.
    encoder: Encoder,
    is_watched: Arc<AtomicBool>,
    captured_ns: u64,
}

/// A picture in the readers' format.
struct Picture {
    format: Format,
    bytes: Vec<u8>,
}

/// A picture on its way to the node.
struct Frame {
    picture: Pooled<Picture>,
    /// Capture time on the system's monotonic clock.
    captured_ns: u64,
}

impl PipeWire {
    /// Creates a PipeWire camera shown to users as `label` (`None`: bokehcam), with a still card until the first
    /// picture comes. A demand in the options is kept up to date with whether the camera is watched.
    ///
    /// # Errors
    /// PipeWire cannot be reached, or refuses.
    pub fn open(label: Option<&str>, options: &Options) -> Result<Self, SinkError> {
        let label = label.unwrap_or(DEFAULT_NAME);
        let camera =
            Self::new(label, node_name(label), None, |default_format| vec![default_format.to_mode()], options)?;
        let (width, height) = camera.encoder.format().size();
        let description = format!("PipeWire camera {} ({label}), YUY2 {width}x{height}", camera.node.name());
        Ok(Self { description, ..camera })
    }

    /// Creates a filter for the camera that the options [name](Options::filter_target): all clients that request the
    /// camera get the pictures of this sink, in the formats of that camera.
    ///
    /// # Errors
    /// Those of [`PipeWire::open`]; the camera does not exist, or the session manager does not support filters.
    pub fn open_filter(options: &Options) -> Result<Self, SinkError> {
        let camera_name = options.filter_target.as_deref().ok_or(SinkError::Filter)?;
        let camera = Graph::find_filter_target(camera_name)?;
        let modes = writable_modes(&camera.modes);
        if modes.is_empty() {
            let why = "it offers no format that can be written".to_owned();
            return Err(PipeWireError::NoMode { name: camera.name, why }.into());
        }
        let label = format!("{}, blurred", camera.label);
        let name = format!("{DEFAULT_NAME}.{}", camera.name);
        let filter = Self::new(&label, name, Some(camera.name.clone()), |_| modes, options)?;
        let description = format!("all readers of pipewire:{} ({})", camera.name, camera.label);
        Ok(Self { description, ..filter })
    }

    /// Creates the node `name`, which replaces the camera `filter_target` if given, with the modes that `modes` returns
    /// for the default mode.
    fn new(
        label: &str,
        name: String,
        filter_target: Option<String>,
        modes: impl FnOnce(&NegotiatedFormat) -> Vec<Mode>,
        options: &Options,
    ) -> Result<Self, SinkError> {
        let (width, height) = options.out_size.unwrap_or(options.size);
        // Two pixels share their chroma, and readers subsample the height as well.
        let size = ((width & !1).max(2), (height & !1).max(2));
        let (rate, scale) = frame_rate(options.period_ns);
        let saturated = |number: u64| u32::try_from(number).unwrap_or(u32::MAX);
        let default_format = NegotiatedFormat { fourcc: *b"YUYV", size, rate: (saturated(rate), saturated(scale)) };
        let settings = Settings {
            name,
            label: label.to_owned(),
            modes: modes(&default_format),
            best: default_format,
            filter_target,
            hold: (2 * Duration::from_nanos(options.period_ns)).clamp(REPEAT_INTERVAL.0, REPEAT_INTERVAL.1),
        };
        let (sender, receiver) = link::live();
        let node_pictures = NodePictures::new(receiver, &default_format, options.demand.clone());
        let (is_watched, format) = (Arc::clone(&node_pictures.is_watched), Arc::clone(&node_pictures.format));
        let encoder = Encoder::new(Format::from(&default_format)).ok_or(SinkError::Yuyv)?;
        let (first, bytes) = (encoder.format(), encoder.picture_memory().bytes);
        let node = Node::new(settings, node_pictures)?;
        let pictures = Pool::new(MAX_IN_FLIGHT, || Picture { format: first, bytes: vec![0; bytes] });
        Ok(Self {
            node,
            description: String::new(),
            size: options.size,
            sender,
            pictures,
            format,
            encoder,
            is_watched,
            captured_ns: 0,
        })
    }

    fn negotiated_format(&self) -> Format {
        Format::unpack(self.format.load(Ordering::Relaxed))
    }
}

fn add_count(counter: &AtomicU64, pictures: u64) {
    counter.fetch_add(pictures, Ordering::Relaxed);
}

/// Derives a camera's node name from its label: lower-case letters and digits, joined by dashes.
fn node_name(label: &str) -> String {
    let words = label.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    let name = words.map(str::to_lowercase).collect::<Vec<_>>().join("-");
    if name.is_empty() { DEFAULT_NAME.to_owned() } else { name }
}

impl PipeWire {
    /// Sends the node a picture, which `make` creates only if the camera is watched.
    fn send_picture(&mut self, make: impl FnOnce(&mut Self, &mut Picture)) -> ControlFlow<()> {
        if !self.is_watched.load(Ordering::Relaxed) {
            add_count(&self.node.counts().unwatched, 1);
            return ControlFlow::Continue(());
        }
        let Some(mut picture) = self.pictures.try_take() else {
            add_count(&self.node.counts().overtaken, 1);
            return ControlFlow::Continue(());
        };
        make(self, &mut picture);
        match self.sender.send(Frame { picture, captured_ns: self.captured_ns }) {
            Ok(overtaken) => add_count(&self.node.counts().overtaken, overtaken.is_some().into()),
            // The node's thread has panicked, which was printed.
            Err(link::Abandoned) => return ControlFlow::Break(()),
        }
        self.node.wake();
        ControlFlow::Continue(())
    }
}

impl From<PipeWireError> for SinkError {
    fn from(error: PipeWireError) -> Self {
        Self::Camera(error.into())
    }
}

impl Sink for PipeWire {
    fn set_capture_time(&mut self, captured_ns: u64) {
        self.captured_ns = captured_ns;
    }

    fn write_frame(&mut self, frame: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        let format = self.negotiated_format();
        if self.encoder.format() != format
            && let Some(encoder) = Encoder::new(format)
        {
            self.encoder = encoder;
        }
        Ok(self.send_picture(|camera, picture| {
            picture.format = camera.encoder.format();
            camera.encoder.encode(frame, &mut picture.bytes);
        }))
    }

    fn wants_yuyv(&mut self) -> bool {
        self.negotiated_format().is_yuyv(self.size)
    }

    fn write_yuyv(&mut self, frame: &mut YuyvImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        check_size(self.size, frame.size())?;
        Ok(self.send_picture(|camera, picture| {
            // A format negotiated meanwhile applies from the next picture on.
            picture.format = Format::yuyv(camera.size);
            std::mem::swap(&mut picture.bytes, &mut frame.bytes);
        }))
    }

    fn is_live(&self) -> bool {
        true
    }

    fn node_counters(&self) -> Vec<Counter<NodeCounts>> {
        let (node, counts) = (self.node.name().to_owned(), Arc::clone(self.node.counts()));
        let load = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        vec![Arc::new(move || NodeCounts {
            node: node.clone(),
            shown: load(&counts.shown),
            repeats: load(&counts.repeats),
            unwatched: load(&counts.unwatched),
            overtaken: load(&counts.overtaken),
            no_buffer: load(&counts.no_buffer),
            returns: load(&counts.reconnections),
        })]
    }

    fn describe(&self) -> String {
        self.description.clone()
    }
}

/// The node's pictures, on its thread.
struct NodePictures {
    receiver: Receiver<Frame>,
    /// The last picture, while a client watches.
    frame: Option<Frame>,
    /// Whether it was not drawn yet.
    is_new: bool,
    /// Shown while there is no picture, in the negotiated format.
    card: Picture,
    /// Publishes the negotiated format.
    format: Arc<AtomicU64>,
    demand: Option<Demand>,
    watch: Option<Watch>,
    is_watched: Arc<AtomicBool>,
}

impl NodePictures {
    /// Creates the card in `format`, shown until `receiver` has a picture. `demand` is told while a client watches.
    fn new(receiver: Receiver<Frame>, format: &NegotiatedFormat, demand: Option<Demand>) -> Self {
        let mut pictures = Self {
            receiver,
            frame: None,
            is_new: false,
            card: Picture { format: Format::from(format), bytes: Vec::new() },
            format: Arc::default(),
            demand,
            watch: None,
            is_watched: Arc::default(),
        };
        pictures.set_format(format);
        pictures
    }
}

impl PictureSource for NodePictures {
    fn update(&mut self) -> bool {
        let Some(frame) = self.receiver.try_recv() else { return false };
        // A picture that arrives just after the last reader left is dropped.
        self.is_new = self.is_watched.load(Ordering::Relaxed);
        self.frame = self.is_new.then_some(frame);
        true
    }

    fn set_format(&mut self, negotiated: &NegotiatedFormat) -> PictureMemory {
        let Some(mut encoder) = Encoder::new(Format::from(negotiated)) else { return PictureMemory::default() };
        let mut card = ColorImage::new(negotiated.size.0, negotiated.size.1);
        card::draw_card(&mut card);
        self.card.format = encoder.format();
        encoder.encode(&card, &mut self.card.bytes);
        self.format.store(encoder.format().pack(), Ordering::Relaxed);
        encoder.picture_memory()
    }

    fn draw_picture(&mut self, bytes: &mut [u8]) -> DrawnPicture {
        let negotiated = self.card.format;
        let fits = |frame: &&Frame| frame.picture.format == negotiated && frame.picture.bytes.len() <= bytes.len();
        let frame = self.frame.as_ref().filter(fits);
        let picture = frame.map_or(&self.card, |frame| &frame.picture);
        let used = picture.bytes.len().min(bytes.len());
        bytes[..used].copy_from_slice(&picture.bytes[..used]);
        let is_new = std::mem::take(&mut self.is_new);
        DrawnPicture { bytes: used, captured_ns: frame.filter(|_| is_new).map(|frame| frame.captured_ns) }
    }

    fn set_watched(&mut self, is_watched: bool) {
        self.is_watched.store(is_watched, Ordering::Relaxed);
        self.watch = self.demand.as_ref().filter(|_| is_watched).map(Demand::watch);
        if !is_watched {
            // The next reader must not see the last reader's picture.
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
        assert_eq!(node_name("!?"), DEFAULT_NAME);
    }
}
