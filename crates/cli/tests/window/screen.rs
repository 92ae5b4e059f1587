//! A private screen: an X server without hardware, and a window manager.

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use tempfile::TempDir;
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{Atom, AtomEnum, ClientMessageEvent, ConnectionExt, EventMask, Window};
use x11rb::rust_connection::RustConnection;

use super::program::Beside;
pub use super::program::until;
use super::window::PATIENCE;

/// Screen size in pixels.
pub const SIZE: (u16, u16) = (1600, 1000);

/// An X server with a window manager; both end when dropped.
pub struct Screen {
    /// A client connection to the server.
    pub x: RustConnection,
    /// The root window.
    pub root: Window,
    /// The value of `DISPLAY`.
    pub display: String,
    _manager: Beside,
    _server: Beside,
    _settings: TempDir,
}

/// A window manager without key bindings, so that all keys reach the program.
const OPENBOX: &str = r#"<?xml version="1.0"?>
<openbox_config xmlns="http://openbox.org/3.4/rc">
  <focus><focusNew>yes</focusNew></focus>
  <placement><policy>Smart</policy><center>yes</center></placement>
  <theme><name>Clearlooks</name><titleLayout>NLIMC</titleLayout></theme>
  <desktops><number>1</number></desktops>
  <mouse><context name="Client"><mousebind button="Left" action="Press"><action name="Focus"/></mousebind></context></mouse>
</openbox_config>
"#;

impl Screen {
    /// Starts both, and waits until the window manager is ready.
    pub fn new() -> Self {
        let mut xvfb = tied("Xvfb");
        let size = format!("{}x{}x24", SIZE.0, SIZE.1);
        xvfb.args(["-displayfd", "1", "-screen", "0", &size, "-nolisten", "tcp"]);
        let mut server = Beside::start(xvfb.stdout(Stdio::piped()).stderr(Stdio::null()));
        let mut number = String::new();
        BufReader::new(server.0.stdout.as_mut().unwrap()).read_line(&mut number).unwrap();
        assert!(!number.is_empty(), "Xvfb does not start: scripts/setup window installs what is needed");
        let display = format!(":{}", number.trim());

        let settings = tempfile::tempdir().unwrap();
        let (rules, ready) = (settings.path().join("openbox.xml"), settings.path().join("ready"));
        fs::write(&rules, OPENBOX).unwrap();
        let mut openbox = tied("openbox");
        openbox.args(["--sm-disable", "--config-file"]).arg(rules);
        openbox.arg("--startup").arg(format!("touch {}", ready.display()));
        openbox.env("DISPLAY", &display).env("HOME", settings.path()).env_remove("XDG_CONFIG_HOME");
        let manager = Beside::start(openbox.stdout(Stdio::null()).stderr(Stdio::null()));

        let (x, number) = x11rb::connect(Some(&display)).unwrap();
        let root = x.setup().roots[number].root;
        let screen = Self { x, root, display, _manager: manager, _server: server, _settings: settings };
        // A window that opens earlier may stay unmanaged.
        until("a window manager", PATIENCE, || ready.exists());
        screen
    }

    /// Returns the X atom of a name.
    pub fn atom(&self, name: &str) -> Atom {
        self.x.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom
    }

    /// Reads a window's property of 32-bit values; empty if the property or the window does not exist.
    pub fn property(&self, window: Window, name: &str) -> Vec<u32> {
        let asked = self.x.get_property(false, window, self.atom(name), AtomEnum::ANY, 0, 1024).unwrap();
        let Ok(reply) = asked.reply() else { return Vec::new() };
        reply.value32().map(Iterator::collect).unwrap_or_default()
    }

    /// Sends the window manager a client message about a window.
    pub fn ask_manager(&self, window: Window, what: &str, data: [u32; 5]) {
        let message = ClientMessageEvent::new(32, window, self.atom(what), data);
        let to = EventMask::SUBSTRUCTURE_REDIRECT | EventMask::SUBSTRUCTURE_NOTIFY;
        self.x.send_event(false, self.root, to, message).unwrap();
        self.x.flush().unwrap();
    }
}

/// Returns a command whose process is killed when the test ends for any reason.
pub fn tied(program: &str) -> Command {
    let mut command = Command::new("setpriv");
    command.args(["--pdeathsig", "KILL", program]);
    command
}
