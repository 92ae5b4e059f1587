//! A stream on a private D-Bus: methods, signals, and the icon in a fake tray.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::mpsc::{self, Receiver, Sender};
use std::time::{Duration, Instant};

use zbus::blocking::connection::Builder;
use zbus::blocking::{Connection, Proxy};
use zbus::zvariant::OwnedValue;

use crate::program::{Beside, PORTRAIT, Ran};

use super::world::{HANG, World, until};

const NAME: &str = "io.github.bokehcam.bokehcam";
const PATH: &str = "/io/github/bokehcam/bokehcam";
const CAMERA: &str = "io.github.bokehcam.Camera";
const ITEM: &str = "org.kde.StatusNotifierItem";
const WATCHER: &str = "org.kde.StatusNotifierWatcher";

struct Daemon {
    address: String,
    _daemon: Beside,
}

impl Daemon {
    fn start() -> Self {
        let mut daemon = Command::new("dbus-daemon");
        daemon.args(["--session", "--nofork", "--print-address"]).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut daemon = Beside::start(&mut daemon);
        let mut address = String::new();
        BufReader::new(daemon.0.stdout.take().unwrap()).read_line(&mut address).unwrap();
        Self { address: address.trim().to_owned(), _daemon: daemon }
    }

    fn connect(&self) -> Builder<'_> {
        Builder::address(self.address.as_str()).unwrap()
    }
}

/// A fake tray that records registered icons.
struct Watcher(Sender<String>);

#[zbus::interface(name = "org.kde.StatusNotifierWatcher")]
impl Watcher {
    fn register_status_notifier_item(&self, service: String) {
        self.0.send(service).unwrap();
    }
}

fn watcher(daemon: &Daemon) -> (Connection, Receiver<String>) {
    let (to, items) = mpsc::channel();
    let served = daemon.connect().serve_at("/StatusNotifierWatcher", Watcher(to)).unwrap();
    (served.name(WATCHER).unwrap().build().unwrap(), items)
}

/// Whether a name on the bus has an owner.
fn has_owner(bus: &Connection, name: &str) -> bool {
    let asked = bus.call_method(
        Some("org.freedesktop.DBus"),
        "/org/freedesktop/DBus",
        Some("org.freedesktop.DBus"),
        "NameHasOwner",
        &name,
    );
    asked.unwrap().body().deserialize::<bool>().unwrap()
}

/// Starts a stream with a tray icon, and waits until it is on the bus.
fn stream(world: &World, daemon: &Daemon, bus: &Connection) -> Beside {
    let args = ["stream", PORTRAIT, "--loop", "--pace", "realtime", "--quiet", "--to", "null", "--tray"];
    let running = Beside::start(world.bokehcam(&args).env("DBUS_SESSION_BUS_ADDRESS", &daemon.address));
    until("it is on the bus", || has_owner(bus, NAME));
    running
}

#[test]
#[ignore = "needs dbus-daemon"]
fn desktops_switch_it_and_are_told() {
    let (world, daemon) = (World::new(), Daemon::start());
    let bus = daemon.connect().build().unwrap();
    let stream = stream(&world, &daemon, &bus);
    let camera = Proxy::new(&bus, NAME, PATH, CAMERA).unwrap();
    let properties = Proxy::new(&bus, NAME, PATH, "org.freedesktop.DBus.Properties").unwrap();
    let (to, told) = mpsc::channel();
    let signals = properties.receive_signal("PropertiesChanged").unwrap();
    std::thread::spawn(move || {
        for signal in signals {
            type Changed = (String, std::collections::HashMap<String, OwnedValue>, Vec<String>);
            let (_, changed, _) = signal.body().deserialize::<Changed>().unwrap();
            for (name, value) in changed {
                let text = bool::try_from(value.clone()).map(|is| is.to_string());
                let text = text.or_else(|_| String::try_from(value)).unwrap();
                let _ = to.send(format!("{name} {text}"));
            }
        }
    });
    let next = || told.recv_timeout(HANG).expect("a signal");

    assert!(camera.get_property::<bool>("Active").unwrap());
    let presets = camera.get_property::<Vec<String>>("Presets").unwrap();
    assert!(presets.iter().any(|name| name == "dreamy"), "{presets:?}");
    camera.call_method("Toggle", &()).unwrap();
    assert_eq!((next().as_str(), &world.status(&[])["on"]), ("Active false", &false.into()));
    // Signals are sent for changes made by any client.
    world.ctl(&["on"]).done();
    assert_eq!(next(), "Active true");
    camera.call_method("SetPreset", &"dreamy").unwrap();
    assert_eq!(next(), "Preset dreamy");
    world.ctl(&["set", "rim=0.5"]).done();
    assert_eq!((next().as_str(), &world.status(&[])["look"]["rim"]), ("Preset ", &"0.5".into()));
    let refused = camera.call_method("SetPreset", &"nosuch").unwrap_err().to_string();
    assert!(refused.contains("nosuch"), "{refused}");
    // A query changes nothing and sends no signal.
    world.status(&[]);
    assert!(told.recv_timeout(Duration::from_millis(300)).is_err());
    assert_eq!(stream.interrupt(), 0);
}

#[test]
#[ignore = "needs dbus-daemon"]
fn an_icon_is_in_the_tray_and_a_click_switches() {
    let (world, daemon) = (World::new(), Daemon::start());
    let (tray, items) = watcher(&daemon);
    let bus = daemon.connect().build().unwrap();
    let stream = stream(&world, &daemon, &bus);
    let service = items.recv_timeout(HANG).expect("an icon");
    let icon = |service: &str| {
        let item = Proxy::new(&bus, service.to_owned(), "/StatusNotifierItem", ITEM).unwrap();
        item.get_property::<String>("IconName").unwrap()
    };
    assert_eq!(icon(&service), "bokehcam");
    let item = Proxy::new(&bus, service.clone(), "/StatusNotifierItem", ITEM).unwrap();
    item.call_method("Activate", &(3, 4)).unwrap();
    assert_eq!((&world.status(&[])["on"], icon(&service).as_str()), (&false.into(), "camera-disabled-symbolic"));
    item.call_method("Scroll", &(-120, "vertical")).unwrap();
    let camera = Proxy::new(&bus, NAME, PATH, CAMERA).unwrap();
    let presets = camera.get_property::<Vec<String>>("Presets").unwrap();
    let began = Instant::now();
    while camera.get_property::<String>("Preset").unwrap() != presets[0] {
        assert!(began.elapsed() < HANG, "the first preset");
    }
    // A restarted tray gets the icon again.
    tray.close().unwrap();
    until("the tray is gone", || !has_owner(&bus, WATCHER));
    let (_tray, items) = watcher(&daemon);
    assert_eq!(items.recv_timeout(HANG).expect("the icon again"), service);
    assert_eq!(stream.interrupt(), 0);
}

/// Without a bus the stream still runs, and one line reports the missing bus.
#[test]
fn without_a_bus_it_runs() {
    let world = World::new();
    let mut command =
        world.bokehcam(&["stream", "synthetic", "--size", "64x48", "--frames", "2", "--to", "null", "--tray"]);
    let ran = Ran::of(command.env("DBUS_SESSION_BUS_ADDRESS", "unix:path=/nowhere"));
    assert!(ran.done().contains("warning: --tray: the session's message bus: "), "{}", ran.stderr);
}
