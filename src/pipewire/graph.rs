//! What there is in PipeWire's graph now: cameras, and who is connected.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, Instant};

use pipewire::node::{Node, NodeListener};
use pipewire::spa::param::ParamType;
use pipewire::spa::utils::dict::DictRef;
use pipewire::types::ObjectType;

use super::PipeWireError;
use super::mode::{self, Mode};
use super::session::Session;

/// How long the daemon may take to tell what there is.
const PATIENCE: Duration = Duration::from_secs(3);

/// A node that gives video.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// The name by which it is found again.
    pub name: String,
    /// The name for people.
    pub label: String,
    /// Whether it is a camera by its role: programs list those alone.
    pub is_camera: bool,
    /// Who gives it, by process, where that is known.
    pub process: Option<u32>,
    /// What readers call it in this daemon's life.
    pub serial: String,
    /// Formats that are known here, with their sizes and rates; empty where they were not asked for.
    pub modes: Vec<Mode>,
}

/// A camera that can be read from.
pub type Camera = Source;

impl Source {
    /// Whether this very program gives it.
    pub fn is_ours(&self) -> bool {
        self.process == Some(std::process::id())
    }
}

/// What there is.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    /// Nodes that give video, cameras and others.
    pub sources: Vec<Source>,
    /// Names of all nodes.
    pub names: Vec<String>,
    /// Programs that are connected, by their own names.
    pub clients: Vec<String>,
    /// Whether the session manager gives a filter to who asks for the camera that it is for.
    pub has_filters: bool,
}

impl Graph {
    /// Looks at the graph of this session's daemon, without the modes of its cameras.
    ///
    /// # Errors
    /// There is no daemon, or it does not answer.
    pub fn look() -> Result<Self, PipeWireError> {
        Self::of(&Session::open()?, |_| false)
    }

    /// The same with the modes of its cameras.
    ///
    /// # Errors
    /// As for [`Graph::look`].
    pub fn look_closely() -> Result<Self, PipeWireError> {
        Self::of(&Session::open()?, |_| true)
    }

    /// The camera that `name` means, with its modes, for a filter to stand in for.
    ///
    /// # Errors
    /// There is none, there are several, or the session manager knows no filters.
    pub fn filterable(name: &str) -> Result<Camera, PipeWireError> {
        let session = Session::open()?;
        if !Self::of(&session, |_| false)?.has_filters {
            return Err(PipeWireError::NoFilters);
        }
        Self::camera(&session, name, false)
    }

    /// The camera that `name` means, with its modes; with `exactly`, what programs remember it by has to be the same.
    ///
    /// # Errors
    /// There is none, there are several, or this program gives it itself.
    pub(super) fn camera(session: &Session, name: &str, exactly: bool) -> Result<Camera, PipeWireError> {
        let wanted = name.to_lowercase();
        let has_part = move |source: &Source| {
            [&source.name, &source.label].into_iter().any(|text| text.to_lowercase().contains(&wanted))
        };
        let has_name = |source: &Source| source.name == name || (!exactly && source.label == name);
        let mut graph = Self::of(session, has_part.clone())?;
        graph.sources.retain(|source| source.is_camera);
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

    /// Looks at the graph that a session is connected to, with the modes of those that `closely` says.
    pub(super) fn of(session: &Session, closely: impl Fn(&Source) -> bool + 'static) -> Result<Self, PipeWireError> {
        let registry = session.core.get_registry_rc().map_err(PipeWireError::refused("its registry"))?;
        let found: Rc<RefCell<Found>> = Rc::default();
        let (finder, objects) = (Rc::clone(&found), registry.downgrade());
        let _listener = registry
            .add_listener_local()
            .global(move |object| {
                let mut found = finder.borrow_mut();
                let Some(properties) = object.props else { return };
                let is_source = found.add(object.id, &object.type_, properties);
                if let Some(registry) = objects.upgrade().filter(|_| is_source) {
                    found.ask_for_modes(|| registry.bind(object).ok(), &closely);
                }
            })
            .register();
        // Once for what there is, and once for what was asked of that meanwhile.
        for _ in 0..2 {
            let question = session.ask()?;
            let began = Instant::now();
            while !session.has_answered(question) {
                let left = PATIENCE.checked_sub(began.elapsed()).ok_or(PipeWireError::Silent)?;
                session.serve(Some(left));
                if session.is_lost() {
                    return Err(PipeWireError::Silent);
                }
            }
        }
        let graph = found.take().graph();
        Ok(graph)
    }

    /// Whether somebody connects readers with cameras: without, a reader waits for ever.
    pub fn has_session_manager(&self) -> bool {
        let is_manager = |name: &String| name.contains("WirePlumber") || name.contains("pipewire-media-session");
        self.clients.iter().any(is_manager)
    }
}

/// What was told so far.
#[derive(Default)]
struct Found {
    sources: Vec<Told>,
    names: Vec<String>,
    clients: Vec<Client>,
    has_filters: bool,
}

/// A video node.
struct Told {
    source: Source,
    /// The number of the client that gives it.
    client: Option<u32>,
    /// Entries of its list of formats.
    formats: Rc<RefCell<Vec<Vec<u8>>>>,
    /// What listens to it, before what it listens to.
    _asked: Option<(NodeListener, Node)>,
}

struct Client {
    id: u32,
    name: String,
    process: Option<u32>,
}

impl Found {
    /// Takes note of an object; returns whether it is a node that gives video.
    fn add(&mut self, id: u32, kind: &ObjectType, properties: &DictRef) -> bool {
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
                self.sources.push(Told { source, client, formats: Rc::default(), _asked: None });
                true
            }
            ObjectType::Metadata => {
                self.has_filters |= properties.get("metadata.name") == Some("filters");
                false
            }
            _ => false,
        }
    }

    /// Asks the source that was noted last for its formats, if that is wanted.
    fn ask_for_modes(&mut self, bind: impl FnOnce() -> Option<Node>, closely: &impl Fn(&Source) -> bool) {
        let Some(told) = self.sources.last_mut().filter(|told| closely(&told.source)) else { return };
        let Some(node) = bind() else { return };
        let formats = Rc::clone(&told.formats);
        let listener = node
            .add_listener_local()
            .param(move |_, _, _, _, pod| formats.borrow_mut().extend(pod.map(|pod| pod.as_bytes().to_vec())))
            .register();
        node.enum_params(0, Some(ParamType::EnumFormat), 0, u32::MAX);
        told._asked = Some((listener, node));
    }

    fn graph(self) -> Graph {
        let Self { sources, names, clients, has_filters } = self;
        let process = |id: Option<u32>| clients.iter().find(|client| Some(client.id) == id)?.process;
        let sources = sources.into_iter().map(|Told { source, client, formats, .. }| {
            let modes = formats.borrow().iter().flat_map(|pod| mode::read(pod)).collect();
            Source { process: process(client), modes, ..source }
        });
        let clients = clients.iter().map(|client| client.name.clone()).collect();
        Graph { sources: sources.collect(), names, clients, has_filters }
    }
}
