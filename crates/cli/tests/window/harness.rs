//! Tests of the harness itself, on a window that records its events.

use x11rb::connection::Connection;
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    AtomEnum, ConnectionExt, CreateWindowAux, EventMask, PropMode, Rectangle, Window as Id, WindowClass,
};
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

use super::input::sym;
use super::picture::{distance, is_photograph, middle, part};
use super::screen::{Screen, until};
use super::window::{PATIENCE, Window};

/// An X client with one window: yellow, with a blue corner.
struct Own {
    x: RustConnection,
    id: Id,
    seen: Vec<String>,
}

const SIZE: (u32, u32) = (400, 300);
const YELLOW: u32 = 0xff_e0_20;
const BLUE: u32 = 0x10_20_c0;

impl Own {
    fn new(screen: &Screen) -> Self {
        let (x, number) = x11rb::connect(Some(&screen.display)).unwrap();
        let (id, root) = (x.generate_id().unwrap(), &x.setup().roots[number]);
        let events = EventMask::KEY_PRESS
            | EventMask::BUTTON_PRESS
            | EventMask::BUTTON_RELEASE
            | EventMask::BUTTON_MOTION
            | EventMask::EXPOSURE
            | EventMask::STRUCTURE_NOTIFY;
        let look = CreateWindowAux::new().background_pixel(YELLOW).event_mask(events);
        let (width, height) = (SIZE.0 as u16, SIZE.1 as u16);
        x.create_window(24, id, root.root, 0, 0, width, height, 0, WindowClass::INPUT_OUTPUT, 0, &look).unwrap();
        let atom = |name: &str| screen.atom(name);
        let (pid, cardinal) = (std::process::id(), AtomEnum::CARDINAL);
        x.change_property32(PropMode::REPLACE, id, atom("_NET_WM_PID"), cardinal, &[pid]).unwrap();
        let delete = [atom("WM_DELETE_WINDOW")];
        x.change_property32(PropMode::REPLACE, id, atom("WM_PROTOCOLS"), AtomEnum::ATOM, &delete).unwrap();
        let text = atom("UTF8_STRING");
        x.change_property8(PropMode::REPLACE, id, atom("_NET_WM_NAME"), text, "own · 1".as_bytes()).unwrap();
        x.map_window(id).unwrap();
        x.flush().unwrap();
        Self { x, id, seen: Vec::new() }
    }

    /// Records all pending events.
    fn live(&mut self) {
        while let Some(event) = self.x.poll_for_event().unwrap() {
            self.seen.push(match event {
                Event::KeyPress(key) => format!("key {} {:#x}", key.detail, u16::from(key.state)),
                Event::ButtonPress(button) => format!("press {} {},{}", button.detail, button.event_x, button.event_y),
                Event::ButtonRelease(button) => format!("release {}", button.detail),
                Event::MotionNotify(motion) => format!("to {},{}", motion.event_x, motion.event_y),
                Event::ClientMessage(message) => format!("message {}", message.data.as_data32()[0]),
                Event::Expose(_) => {
                    self.paint();
                    continue;
                }
                _ => continue,
            });
        }
    }

    fn paint(&self) {
        let gc = self.x.generate_id().unwrap();
        let blue = x11rb::protocol::xproto::CreateGCAux::new().foreground(BLUE);
        self.x.create_gc(gc, self.id, &blue).unwrap();
        let corner = Rectangle { x: 0, y: 0, width: 100, height: 50 };
        self.x.poly_fill_rectangle(self.id, gc, &[corner]).unwrap();
        self.x.flush().unwrap();
    }

    /// Waits for at least `count` events since the last call, and returns them.
    fn told(&mut self, count: usize) -> Vec<String> {
        until("events", PATIENCE, || {
            self.live();
            self.seen.len() >= count
        });
        std::mem::take(&mut self.seen)
    }

    /// Waits for an event, and returns it with those since the last call.
    fn told_up_to(&mut self, event: &str) -> Vec<String> {
        until(event, PATIENCE, || {
            self.live();
            self.seen.iter().any(|line| line == event)
        });
        std::mem::take(&mut self.seen)
    }
}

#[test]
#[ignore = "needs an X server"]
fn what_is_on_the_screen_is_seen() {
    let screen = Screen::new();
    let mut own = Own::new(&screen);
    until("the window", PATIENCE, || Window::of(&screen, std::process::id()).is_some());
    let window = Window::of(&screen, std::process::id()).unwrap();
    assert_eq!((window.id, window.size(), window.title().as_str()), (own.id, SIZE, "own · 1"));
    let image = window.until("a blue corner", |image| {
        own.live();
        image.rgb[..3] == [0x10, 0x20, 0xc0]
    });
    let corner = part(&image, (0, 0), (100, 50));
    assert!(corner.rgb.as_chunks::<3>().0.iter().all(|rgb| *rgb == [0x10, 0x20, 0xc0]));
    assert!(middle(&image).rgb.as_chunks::<3>().0.iter().all(|rgb| *rgb == [0xff, 0xe0, 0x20]));
    assert!(!is_photograph(&image));
    assert!(distance(&image, &image) < 1e-9 && distance(&corner, &part(&image, (200, 100), (100, 50))) > 100.0);

    window.resize(640, 320);
    until("another size", PATIENCE, || window.size() == (640, 320));
    window.minimise();
    assert!(window.look().is_none(), "what is put away is not seen");
    window.bring_back();
    window.until("it is back", |image| {
        own.live();
        image.rgb[..3] == [0x10, 0x20, 0xc0] && image.size() == (640, 320)
    });
    const ADD: u32 = 1;
    assert!(!window.is_full_screen());
    screen.ask_manager(window.id, "_NET_WM_STATE", [ADD, screen.atom("_NET_WM_STATE_FULLSCREEN"), 0, 1, 0]);
    until("full screen", PATIENCE, || {
        window.is_full_screen() && window.size() == (1600, 1000) && window.place() == (0, 0)
    });
}

#[test]
#[ignore = "needs an X server"]
fn keys_and_pointer_arrive() {
    let screen = Screen::new();
    let mut own = Own::new(&screen);
    until("the window", PATIENCE, || Window::of(&screen, std::process::id()).is_some_and(|window| window.is_active()));
    let window = Window::of(&screen, std::process::id()).unwrap();
    let state = |line: &str| line.rsplit(' ').next().unwrap().to_owned();

    window.write("a?");
    let told = own.told(3);
    assert_eq!(told.iter().map(|line| state(line)).collect::<Vec<_>>(), ["0x0", "0x0", "0x1"], "{told:?}");
    window.key(&[sym::CONTROL, sym::SHIFT], u32::from('z'));
    let told = own.told(3);
    assert_eq!(state(&told[2]), "0x5", "{told:?}");

    window.click((0.25, 0.5), 2);
    assert_eq!(own.told(4), ["press 1 100,150", "release 1", "press 1 100,150", "release 1"]);
    window.wheel((0.5, 0.5), -2);
    assert_eq!(own.told(4), ["press 5 200,150", "release 5", "press 5 200,150", "release 5"]);
    window.drag((0.25, 0.5), (0.75, 0.5));
    // The server may replace queued moves by the last of them.
    let told = own.told_up_to("release 1");
    let [press, moves @ .., release] = &told[..] else { panic!("{told:?}") };
    assert_eq!((press.as_str(), release.as_str()), ("press 1 100,150", "release 1"));
    assert!(moves.is_sorted_by_key(|line| line[3..6].parse::<i32>().unwrap()), "{told:?}");
    assert_eq!(moves.last().map(String::as_str), Some("to 300,150"));

    window.close();
    assert_eq!(own.told(1), [format!("message {}", screen.atom("WM_DELETE_WINDOW"))]);
}
