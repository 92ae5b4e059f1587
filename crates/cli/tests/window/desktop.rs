//! Desktop integration: colour scheme and screen reader, over a private session bus.

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::Stdio;
use std::time::Duration;

use bokehcam::frame::ColorImage;
use zbus::blocking::connection::Builder;
use zbus::blocking::{Connection, Proxy, proxy};
use zbus::proxy::CacheProperties;
use zbus::zvariant::{OwnedObjectPath, OwnedValue, Value};

use super::preview::Program;
use super::program::{Beside, Home, PORTRAIT};
use super::screen::{Screen, tied, until};
use super::window::PATIENCE;

/// A private session bus, which ends when dropped.
struct Bus {
    address: String,
    _daemon: Beside,
}

impl Bus {
    fn new() -> Self {
        let mut daemon = tied("dbus-daemon");
        daemon.args(["--session", "--nofork", "--nopidfile", "--print-address"]);
        // Prevents bus activation of the machine's own desktop services.
        daemon.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
        let mut daemon = Beside::start(daemon.stdout(Stdio::piped()).stderr(Stdio::null()));
        let mut address = String::new();
        BufReader::new(daemon.0.stdout.as_mut().unwrap()).read_line(&mut address).unwrap();
        assert!(!address.is_empty(), "dbus-daemon does not start: scripts/setup window installs it");
        Self { address: address.trim().to_owned(), _daemon: daemon }
    }

    fn connect(&self) -> Builder<'_> {
        Builder::address(self.address.as_str()).unwrap()
    }
}

/// A fake desktop portal with only the colour scheme; holds the initial value.
struct Portal(u32);

const APPEARANCE: &str = "org.freedesktop.appearance";
const PATH: &str = "/org/freedesktop/portal/desktop";
const SETTINGS: &str = "org.freedesktop.portal.Settings";

#[zbus::interface(name = "org.freedesktop.portal.Settings")]
impl Portal {
    /// The deprecated `Read` method, which wraps the value in a second variant.
    fn read(&self, namespace: &str, key: &str) -> zbus::fdo::Result<OwnedValue> {
        if (namespace, key) != (APPEARANCE, "color-scheme") {
            return Err(zbus::fdo::Error::Failed("there is no such setting".into()));
        }
        Ok(OwnedValue::try_from(Value::Value(Box::new(Value::U32(self.0)))).unwrap())
    }
}

const DARK: u32 = 1;
const LIGHT: u32 = 2;

/// Whether the background beside the picture is light.
fn is_light(image: &ColorImage) -> bool {
    image.rgb[..3].iter().all(|byte| *byte > 200)
}

fn is_dark(image: &ColorImage) -> bool {
    image.rgb[..3].iter().all(|byte| *byte < 50) && image.rgb[..3].iter().any(|byte| *byte > 0)
}

#[test]
#[ignore = "needs an X server"]
fn light_and_dark_follow_the_desktop() {
    let (screen, bus) = (Screen::new(), Bus::new());
    let portal = bus.connect().name("org.freedesktop.portal.Desktop").unwrap().serve_at(PATH, Portal(LIGHT)).unwrap();
    let portal: Connection = portal.build().unwrap();
    let change = |to: u32| {
        let body = (APPEARANCE, "color-scheme", Value::U32(to));
        portal.emit_signal(None::<&str>, PATH, SETTINGS, "SettingChanged", &body).unwrap();
    };
    let start = |bus: &str, more: &[&str]| {
        let arguments: Vec<&str> = [PORTRAIT, "--panel=false"].iter().chain(more).copied().collect();
        let mut program = Program::start_on(&screen, Home::new(), bus, &arguments);
        let window = program.window();
        // The window's aspect ratio differs from the picture's, so that its upper left corner shows the background.
        window.resize(640, 640);
        (program, window)
    };
    let (program, window) = start(&bus.address, &[]);
    window.until("light, as the desktop is", is_light);
    change(DARK);
    window.until("dark, as the desktop is now", is_dark);
    change(LIGHT);
    window.until("light again", is_light);
    program.close();
    let (program, window) = start(&bus.address, &["--theme", "dark"]);
    window.until("dark, as it was asked for", is_dark);
    program.close();
    let (program, window) = start("unix:path=/none", &[]);
    window.until("dark, as nobody says anything", is_dark);
    let ended = program.close();
    assert!(!ended.said.contains("scheme"), "{}", ended.said);
}

/// Role numbers of AT-SPI.
const BUTTON: u32 = 43;
const SLIDER: u32 = 51;

/// A control as a screen reader sees it.
#[derive(Debug)]
struct Told {
    name: String,
    role: u32,
    bus: String,
    path: OwnedObjectPath,
}

/// Collects the accessible objects below a node, recursively.
fn read(access: &Connection, (bus, path): (&str, &str), found: &mut Vec<Told>) -> zbus::Result<()> {
    let place = proxy::Builder::<Proxy>::new(access).destination(bus.to_owned())?.path(path.to_owned())?;
    let place = place.interface("org.a11y.atspi.Accessible")?.cache_properties(CacheProperties::No).build()?;
    let path = OwnedObjectPath::try_from(path.to_owned())?;
    let (name, role) = (place.get_property("Name")?, place.call("GetRole", &())?);
    found.push(Told { name, role, bus: bus.to_owned(), path });
    let children: Vec<(String, OwnedObjectPath)> = place.call("GetChildren", &())?;
    children.iter().try_for_each(|(bus, path)| read(access, (bus, path.as_str()), found))
}

#[test]
#[ignore = "needs an X server"]
fn a_screen_reader_finds_the_controls_and_works_them() {
    let (screen, bus) = (Screen::new(), Bus::new());
    let session = bus.connect().build().unwrap();
    let status = Proxy::new(&session, "org.a11y.Bus", "/org/a11y/bus", "org.a11y.Status").unwrap();
    for on in ["IsEnabled", "ScreenReaderEnabled"] {
        status.set_property(on, true).expect("no at-spi2-core: scripts/setup window installs it");
    }
    let launcher = Proxy::new(&session, "org.a11y.Bus", "/org/a11y/bus", "org.a11y.Bus").unwrap();
    let address: String = launcher.call("GetAddress", &()).unwrap();
    let access = Builder::address(address.as_str()).unwrap().build().unwrap();

    let mut program = Program::start_on(&screen, Home::new(), &bus.address, &[PORTRAIT, "--mirror", "--blur", "4%"]);
    program.window();
    // Longer than an unused panel stays visible.
    std::thread::sleep(Duration::from_secs(6));
    let registry = ("org.a11y.atspi.Registry", "/org/a11y/atspi/accessible/root");
    let mut told = Vec::new();
    until("the controls are told", PATIENCE, || {
        told.clear();
        // An object may disappear during the query; then the query is repeated.
        read(&access, registry, &mut told).is_ok()
            && ["Snapshot", "More"].iter().all(|name| told.iter().any(|told| told.name == *name))
            && told.iter().any(|told| told.name == "Blur" && told.role == SLIDER)
    });
    let by_name = |name: &str| {
        let found = told.iter().find(|told| told.name == name);
        found.unwrap_or_else(|| panic!("no {name:?} in {told:#?}"))
    };
    let blur = told.iter().find(|told| told.name == "Blur" && told.role == SLIDER).expect("the blur");
    let value = Proxy::new(&access, blur.bus.as_str(), blur.path.as_str(), "org.a11y.atspi.Value").unwrap();
    let value: f64 = value.get_property("CurrentValue").unwrap();
    assert!((value - 4.0).abs() < 1e-3, "{value}");

    let press = |name: &str| {
        let button = by_name(name);
        let action = Proxy::new(&access, button.bus.as_str(), button.path.as_str(), "org.a11y.atspi.Action").unwrap();
        assert!(action.call::<_, _, bool>("DoAction", &(0i32,)).unwrap());
    };
    press("Snapshot");
    let is_snapshot = |file: fs::DirEntry| file.file_name().as_encoded_bytes().starts_with(b"bokehcam 20");
    until("the snapshot", PATIENCE, || fs::read_dir(program.home()).unwrap().flatten().any(is_snapshot));
    press("More");
    until("all else is told", PATIENCE, || {
        let mut more = Vec::new();
        read(&access, registry, &mut more).is_ok()
            && more.iter().any(|told| told.name == "Undo (Ctrl+Z)" && told.role == BUTTON)
    });
    program.close();
}
