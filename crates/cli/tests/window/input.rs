//! Synthetic keyboard and pointer input, which the X server delivers to the focused window.

use std::thread;
use std::time::Duration;

use x11rb::connection::Connection;
use x11rb::protocol::xproto::{
    BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, ConnectionExt as _, KEY_PRESS_EVENT, KEY_RELEASE_EVENT,
    MOTION_NOTIFY_EVENT,
};
use x11rb::protocol::xtest::ConnectionExt as _;

use super::screen::until;
use super::window::{PATIENCE, Window};

/// Pointer button numbers.
pub const LEFT: u8 = 1;
const WHEEL_UP: u8 = 4;
const WHEEL_DOWN: u8 = 5;

/// The pause between two events.
const BLINK: Duration = Duration::from_millis(15);

/// X keysyms of the keys used in tests; a character's keysym is its Latin-1 code.
pub mod sym {
    pub const SHIFT: u32 = 0xffe1;
    pub const CONTROL: u32 = 0xffe3;
    pub const ESCAPE: u32 = 0xff1b;
    pub const F1: u32 = 0xffbe;
    pub const F11: u32 = 0xffc8;
}

impl Window<'_> {
    /// Presses and releases a key while the modifiers `held` are down.
    pub fn key(&self, held: &[u32], symbol: u32) {
        until("keys go to the window", PATIENCE, || self.is_active());
        let (code, shifted) = self.keycode(symbol);
        let mut held: Vec<u8> = held.iter().map(|symbol| self.keycode(*symbol).0).collect();
        if shifted {
            held.push(self.keycode(sym::SHIFT).0);
        }
        held.iter().for_each(|held| self.fake(KEY_PRESS_EVENT, *held, (0, 0)));
        self.fake(KEY_PRESS_EVENT, code, (0, 0));
        self.fake(KEY_RELEASE_EVENT, code, (0, 0));
        held.iter().rev().for_each(|held| self.fake(KEY_RELEASE_EVENT, *held, (0, 0)));
        thread::sleep(BLINK);
    }

    /// Types a text, one character at a time.
    pub fn write(&self, text: &str) {
        text.chars().for_each(|c| self.key(&[], u32::from(c)));
    }

    /// Moves the pointer to a position in the window, as fractions of its width and height.
    pub fn point(&self, at: (f64, f64)) {
        let ((left, top), (width, height)) = (self.place(), self.size());
        let (x, y) = (left + (at.0 * f64::from(width)) as i32, top + (at.1 * f64::from(height)) as i32);
        self.fake(MOTION_NOTIFY_EVENT, 0, (x as i16, y as i16));
        thread::sleep(BLINK);
    }

    /// Clicks `times` times in quick succession.
    pub fn click(&self, at: (f64, f64), times: u32) {
        self.point(at);
        for _ in 0..times {
            self.button(LEFT);
        }
    }

    /// Drags from one position to another in small steps.
    pub fn drag(&self, from: (f64, f64), to: (f64, f64)) {
        const STEPS: i32 = 20;
        self.point(from);
        self.fake(BUTTON_PRESS_EVENT, LEFT, (0, 0));
        for step in 1..=STEPS {
            let part = f64::from(step) / f64::from(STEPS);
            self.point((from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1)));
        }
        self.fake(BUTTON_RELEASE_EVENT, LEFT, (0, 0));
        thread::sleep(BLINK);
    }

    /// Turns the wheel by `clicks`, up if positive, with the pointer at a position.
    pub fn wheel(&self, at: (f64, f64), clicks: i32) {
        self.point(at);
        for _ in 0..clicks.abs() {
            self.button(if clicks > 0 { WHEEL_UP } else { WHEEL_DOWN });
        }
    }

    fn button(&self, button: u8) {
        self.fake(BUTTON_PRESS_EVENT, button, (0, 0));
        self.fake(BUTTON_RELEASE_EVENT, button, (0, 0));
        thread::sleep(BLINK);
    }

    fn fake(&self, kind: u8, detail: u8, (x, y): (i16, i16)) {
        let screen = self.screen;
        screen.x.xtest_fake_input(kind, detail, 0, screen.root, x, y, 0).unwrap();
        screen.x.flush().unwrap();
    }

    /// Returns the keycode of a keysym, and whether it needs Shift.
    fn keycode(&self, symbol: u32) -> (u8, bool) {
        let x = &self.screen.x;
        let (first, last) = (x.setup().min_keycode, x.setup().max_keycode);
        let map = x.get_keyboard_mapping(first, last - first + 1).unwrap().reply().unwrap();
        let each = usize::from(map.keysyms_per_keycode);
        let at = |column: usize| {
            let found = map.keysyms.chunks_exact(each).position(|symbols| symbols[column] == symbol)?;
            Some((first + found as u8, column == 1))
        };
        at(0).or_else(|| at(1)).unwrap_or_else(|| panic!("no key has the symbol {symbol:#x}"))
    }
}
