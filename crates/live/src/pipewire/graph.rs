//! Snapshot of PipeWire's graph: cameras and connected clients.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, Instant};

use pipewire::node::{Node, NodeListener};
use pipewire::spa::param::ParamType;
use pipewire::spa::utils::dict::DictRef;
use pipewire::types::ObjectType;

use super::mode::{self, Mode};
use super::session::Session;
use super::{PipeWireError, Result};

/// Longest wait for the daemon to list its objects.
const TIMEOUT: Duration = Duration::from_secs(3);

/// A node that provides video.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// The name that identifies it.
    pub name: String,
    /// The name for users.
    pub label: String,
    /// Whether its role is `Camera`: programs list only such nodes.
    pub is_camera: bool,
    /// The process that provides it, if known.
    pub process: Option<u32>,
    /// Its identifier for readers while the daemon runs.
    pub serial: String,
    /// Supported formats with their sizes and rates; empty if they were not requested.
    pub modes: Vec<Mode>,
}

/// A camera that can be read.
pub type Camera = Source;

impl Source {
    /// Whether this program itself provides it.
    pub fn is_ours(&self) -> bool {
        self.process == Some(std::process::id())
    }
}

/// The objects in the graph.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    /// Nodes that provide video, cameras and others.
    pub sources: Vec<Source>,
    /// Names of all nodes.
    pub names: Vec<String>,
    /// Names of the connected programs.
    pub clients: Vec<String>,
    /// Whether the session manager supports filters that stand in for a camera.
    pub has_filters: bool,
}

impl Graph {
    /// Lists the objects of this session's daemon, without the cameras' modes.
    ///
    /// # Errors
    /// The daemon does not run, or does not answer.
    pub fn list_without_modes() -> Result<Self> {
        Self::list_objects(&Session::open()?, |_| false)
    }

    /// Lists the objects of this session's daemon, with the cameras' modes.
    ///
    /// # Errors
    /// The daemon does not run, or does not answer.
    pub fn list_with_modes() -> Result<Self> {
        Self::list_objects(&Session::open()?, |_| true)
    }

    /// Finds the camera that `name` refers to, with its modes, for a filter to stand in for.
    ///
    /// # Errors
    /// No camera matches, several do, or the session manager does not support filters.
    pub fn find_filter_target(name: &str) -> Result<Camera> {
        let session = Session::open()?;
        if !Self::list_objects(&session, |_| false)?.has_filters {
            return Err(PipeWireError::NoFilters);
        }
        Self::find_camera(&session, name, false)
    }

    /// Finds the camera that `name` refers to, with its modes; with `exactly`, only by its identifying name.
    ///
    /// # Errors
    /// No camera matches, several do, or this program itself provides it.
    pub(super) fn find_camera(session: &Session, name: &str, exactly: bool) -> Result<Camera> {
        let wanted = name.to_lowercase();
        let has_part = move |source: &Source| {
            [&source.name, &source.label].into_iter().any(|text| text.to_lowercase().contains(&wanted))
        };
        let has_name = |source: &Source| source.name == name || (!exactly && source.label == name);
        let mut graph = Self::list_objects(session, has_part.clone())?;
        graph.sources.retain(|source| source.is_camera);
        // An exact name takes precedence over a partial match.
        let found = match graph.sources.iter().position(has_name) {
            Some(found) => found,
            None => {
                let by_part = |(_, source): &(usize, &Source)| !exactly && !name.is_empty() && has_part(source);
                match graph.sources.iter().enumerate().filter(by_part).collect::<Vec<_>>()[..] {
                    [(found, _)] => found,
                    [] => {
                        let others = graph.sources.iter().map(|source| format!("pipewire:{}", source.name)).collect();
                        return Err(PipeWireError::NoCamera { name: name.to_owned(), others });
                    }
                    ref several => {
                        let found = several.iter().map(|(_, source)| format!("pipewire:{}", source.name)).collect();
                        return Err(PipeWireError::Ambiguous { name: name.to_owned(), found });
                    }
                }
            }
        };
        let camera = graph.sources.swap_remove(found);
        if camera.is_ours() { Err(PipeWireError::Own { name: camera.name }) } else { Ok(camera) }
    }

    /// Lists the objects of the daemon that a session is connected to, with the modes of the sources for which
    /// `wants_modes` is true.
    pub(super) fn list_objects(session: &Session, wants_modes: impl Fn(&Source) -> bool + 'static) -> Result<Self> {
        let registry = session.core.get_registry_rc().map_err(PipeWireError::refused("its registry"))?;
        let found: Rc<RefCell<Listing>> = Rc::default();
        let (finder, objects) = (Rc::clone(&found), registry.downgrade());
        let _listener = registry
            .add_listener_local()
            .global(move |object| {
                let mut found = finder.borrow_mut();
                let Some(properties) = object.props else { return };
                let is_source = found.add_object(object.id, &object.type_, properties);
                if let Some(registry) = objects.upgrade().filter(|_| is_source) {
                    found.request_modes(|| registry.bind(object).ok(), &wants_modes);
                }
            })
            .register();
        // One round trip lists the objects, and a second one returns the modes requested meanwhile.
        for _ in 0..2 {
            let round_trip = session.sync()?;
            let started = Instant::now();
            while !session.is_synced(round_trip) {
                let left = TIMEOUT.checked_sub(started.elapsed()).ok_or(PipeWireError::Silent)?;
                session.iterate(Some(left));
                if session.is_lost() {
                    return Err(PipeWireError::Silent);
                }
            }
        }
        let graph = found.take().into_graph();
        Ok(graph)
    }

    /// Whether a session manager runs, which connects readers with cameras: without one, a reader waits forever.
    pub fn has_session_manager(&self) -> bool {
        let is_manager = |name: &String| name.contains("WirePlumber") || name.contains("pipewire-media-session");
        self.clients.iter().any(is_manager)
    }
}

/// The objects listed so far.
#[derive(Default)]
struct Listing {
    sources: Vec<VideoNode>,
    names: Vec<String>,
    clients: Vec<Client>,
    has_filters: bool,
}

/// A video node, with its list of formats.
struct VideoNode {
    source: Source,
    /// Id of the client that provides it.
    client: Option<u32>,
    /// Entries of its list of formats.
    formats: Rc<RefCell<Vec<Vec<u8>>>>,
    /// The listener, dropped before the node it listens to.
    _subscription: Option<(NodeListener, Node)>,
}

struct Client {
    id: u32,
    name: String,
    process: Option<u32>,
}

impl Listing {
    /// Records an object; returns whether it is a node that provides video.
    fn add_object(&mut self, id: u32, kind: &ObjectType, properties: &DictRef) -> bool {
        let text = |key: &str| properties.get(key).map(str::to_owned);
        let number = |key: &str| properties.get(key).and_then(|text| text.parse().ok());
        match kind {
            ObjectType::Client => {
                let name = text("application.name").unwrap_or_default();
                self.clients.push(Client { id, name, process: number("pipewire.sec.pid") });
                false
            }
            ObjectType::Node => {
                let Some(name) = text("node.name") else { return false };
                self.names.push(name.clone());
                if properties.get("media.class") != Some("Video/Source") {
                    return false;
                }
                let source = Source {
                    label: text("node.description").or_else(|| text("node.nick")).unwrap_or_else(|| name.clone()),
                    is_camera: properties.get("media.role") == Some("Camera"),
                    process: None,
                    serial: text("object.serial").unwrap_or_else(|| name.clone()),
                    modes: Vec::new(),
                    name,
                };
                let client = number("client.id");
                self.sources.push(VideoNode { source, client, formats: Rc::default(), _subscription: None });
                true
            }
            // Session managers that support filters publish this metadata object.
            ObjectType::Metadata => {
                self.has_filters |= properties.get("metadata.name") == Some("filters");
                false
            }
            _ => false,
        }
    }

    /// Requests the formats of the last recorded source, if `wants_modes` is true for it.
    fn request_modes(&mut self, bind: impl FnOnce() -> Option<Node>, wants_modes: &impl Fn(&Source) -> bool) {
        let Some(video_node) = self.sources.last_mut().filter(|video_node| wants_modes(&video_node.source)) else {
            return;
        };
        let Some(node) = bind() else { return };
        let formats = Rc::clone(&video_node.formats);
        let listener = node
            .add_listener_local()
            .param(move |_, _, _, _, pod| formats.borrow_mut().extend(pod.map(|pod| pod.as_bytes().to_vec())))
            .register();
        node.enum_params(0, Some(ParamType::EnumFormat), 0, u32::MAX);
        video_node._subscription = Some((listener, node));
    }

    fn into_graph(self) -> Graph {
        let Self { sources, names, clients, has_filters } = self;
        let process = |id: Option<u32>| clients.iter().find(|client| Some(client.id) == id)?.process;
        let sources = sources.into_iter().map(|VideoNode { source, client, formats, .. }| {
            let modes = formats.borrow().iter().flat_map(|pod| mode::parse_modes(pod)).collect();
            Source { process: process(client), modes, ..source }
        });
        let clients = clients.iter().map(|client| client.name.clone()).collect();
        Graph { sources: sources.collect(), names, clients, has_filters }
    }
}
