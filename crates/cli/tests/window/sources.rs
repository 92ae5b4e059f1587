//! Changing the source by drag and drop, playback of a recording, and zoom.

use std::time::Instant;

use bokehcam::frame::ColorImage;
use x11rb::connection::Connection;
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    ClientMessageEvent, ConnectionExt, CreateWindowAux, EventMask, PropMode, SELECTION_NOTIFY_EVENT,
    SelectionNotifyEvent, WindowClass,
};
use x11rb::wrapper::ConnectionExt as _;

use super::picture::{distance, is_photograph, keep, part};
use super::preview::Program;
use super::program::PORTRAIT;
use super::screen::{Screen, until};
use super::window::{PATIENCE, Window};

/// Drops files from another program onto the window, by the XDND protocol.
fn drop_on(window: &Window, files: &[String]) {
    let screen = window.screen;
    let (x, number) = x11rb::connect(Some(&screen.display)).unwrap();
    let (own, root) = (x.generate_id().unwrap(), x.setup().roots[number].root);
    let look = CreateWindowAux::new();
    x.create_window(24, own, root, 0, 0, 1, 1, 0, WindowClass::INPUT_OUTPUT, 0, &look).unwrap();
    let atom = |name: &str| screen.atom(name);
    x.set_selection_owner(own, atom("XdndSelection"), x11rb::CURRENT_TIME).unwrap();
    let send = |what: &str, data: [u32; 5]| {
        let message = ClientMessageEvent::new(32, window.id, atom(what), data);
        x.send_event(false, window.id, EventMask::NO_EVENT, message).unwrap();
        x.flush().unwrap();
    };
    let (left, top) = window.place();
    let at = ((left as u32 + 100) << 16) | (top as u32 + 100);
    let uris: String = files.iter().map(|file| format!("file://{file}\r\n")).collect();
    send("XdndEnter", [own, 5 << 24, atom("text/uri-list"), 0, 0]);
    send("XdndPosition", [own, 0, at, x11rb::CURRENT_TIME, atom("XdndActionCopy")]);
    let (mut given, mut status, began) = (false, false, Instant::now());
    while !(given && status) {
        assert!(began.elapsed() < PATIENCE, "the window takes no part in it");
        match x.poll_for_event().unwrap() {
            Some(Event::SelectionRequest(asked)) => {
                let (to, property) = (asked.requestor, asked.property);
                x.change_property8(PropMode::REPLACE, to, property, asked.target, uris.as_bytes()).unwrap();
                let told = SelectionNotifyEvent {
                    response_type: SELECTION_NOTIFY_EVENT,
                    sequence: 0,
                    time: asked.time,
                    requestor: to,
                    selection: asked.selection,
                    target: asked.target,
                    property,
                };
                x.send_event(false, to, EventMask::NO_EVENT, told).unwrap();
                x.flush().unwrap();
                given = true;
            }
            Some(Event::ClientMessage(message)) => status |= message.type_ == atom("XdndStatus"),
            Some(_) => {}
            None => std::thread::sleep(std::time::Duration::from_millis(5)),
        }
    }
    send("XdndDrop", [own, 0, x11rb::CURRENT_TIME, 0, 0]);
    until("the drop is over", PATIENCE, || match x.poll_for_event().unwrap() {
        Some(Event::ClientMessage(message)) => message.type_ == atom("XdndFinished"),
        _ => false,
    });
}

#[test]
#[ignore = "needs an X server"]
fn a_photo_or_folder_dropped_on_the_window_is_opened_and_nonsense_changes_nothing() {
    let screen = Screen::new();
    let mut program = Program::start(&screen, &["synthetic", "-v"]);
    let window = program.window();
    window.until("the scene", is_photograph);
    let files = tempfile::tempdir().unwrap();
    let path = |name: &str| files.path().join(name).display().to_string();
    std::fs::write(path("letter.txt"), "Dear all").unwrap();
    let mut photo = ColorImage::new(320, 180);
    photo.rgb.as_chunks_mut::<3>().0.fill([200, 40, 20]);
    bokehcam_media::recording::still::write_color(files.path().join("red one.png").as_ref(), &photo, false).unwrap();
    drop_on(&window, &[path("letter.txt")]);
    until("it is told", PATIENCE, || program.said().contains("neither a folder, a photo nor a video"));
    assert!(window.title().contains("synthetic"), "{}", window.title());
    drop_on(&window, &[path("red%20one.png"), path("letter.txt")]);
    until("the photo", PATIENCE, || window.title().contains("red one.png"));
    let is_red = |image: &ColorImage| {
        // An area above the tilt-shift markers.
        let clear = part(image, (300, 100), (200, 150));
        clear.rgb.as_chunks::<3>().0.iter().all(|rgb| rgb[0] > 150 && rgb[1] < 90)
    };
    window.until("it is red", is_red);
    drop_on(&window, &[PORTRAIT.to_owned()]);
    until("the recording", PATIENCE, || window.title().contains("portrait"));
    window.until("it plays", is_photograph);
    program.close();
}

#[test]
#[ignore = "needs an X server"]
fn a_recording_is_stepped_through_and_its_pixels_are_shown_as_they_are() {
    let screen = Screen::new();
    let mut program = Program::start(&screen, &[PORTRAIT, "--panel=false", "--effect", "none"]);
    let window = program.window();
    window.until("the recording", is_photograph);
    const HOME: u32 = 0xff50;
    const PAGE_DOWN: u32 = 0xff56;
    const PAGE_UP: u32 = 0xff55;
    window.key(&[], u32::from('z'));
    window.key(&[], HOME);
    let frame = |name: &str| {
        let file = format!("{PORTRAIT}/rgb/{name}.png");
        bokehcam_media::recording::still::read_color(file.as_ref()).unwrap()
    };
    // In a smaller window, 100 % zoom shows the recording's pixels unscaled in the middle.
    window.resize(600, 400);
    until("another size", PATIENCE, || window.size() == (600, 400));
    window.point((0.5, 0.5));
    window.key(&[], u32::from('x'));
    let shows = |picture: &ColorImage| {
        let picture = part(picture, (220, 130), (200, 100));
        let seen = window.until("the very pixels of the frame", |image| {
            let (width, height) = image.size();
            distance(&part(image, (width / 2 - 100, height / 2 - 50), (200, 100)), &picture) < 0.5
        });
        keep(&seen, "at 100 percent")
    };
    println!("{}", shows(&frame("000000")));
    for (key, name) in
        [(PAGE_DOWN, "000001"), (PAGE_DOWN, "000002"), (PAGE_UP, "000001"), (HOME, "000000"), (PAGE_UP, "000023")]
    {
        window.key(&[], key);
        println!("{name}: {}", shows(&frame(name)));
    }
    program.close();
}
