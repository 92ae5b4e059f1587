//! The PipeWire output as a camera in real browsers, by way of the desktop portal.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::session::{Run, folder, node, state, until};

/// The picture's patches from left to right: black, white, greys, and colours well within the YUV gamut.
const PATCHES: [[u8; 3]; 8] = [
    [0, 0, 0],
    [255, 255, 255],
    [128, 128, 128],
    [64, 64, 64],
    [200, 60, 60],
    [60, 160, 60],
    [60, 60, 200],
    [230, 180, 140],
];
const SIZE: (usize, usize) = (640, 360);
/// Tolerance in 8-bit codes.
const NEAR: u8 = 3;
/// Timeout against hangs; longer than a browser's first start on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);
/// Maximum number of browser starts.
const STARTS: usize = 3;

/// A background process, ended when dropped.
struct Beside(Child);

impl Beside {
    fn start(command: &mut Command) -> Self {
        Self(command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
    }
}

impl Drop for Beside {
    fn drop(&mut self) {
        let _ = Command::new("kill").arg(self.0.id().to_string()).status();
        let began = Instant::now();
        while self.0.try_wait().is_ok_and(|ended| ended.is_none()) && began.elapsed() < Duration::from_secs(5) {
            std::thread::sleep(Duration::from_millis(50));
        }
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A desktop for browsers: a screen, and a portal that grants access to cameras.
struct Desktop {
    display: String,
    _screen: Beside,
    _portal: Beside,
}

impl Desktop {
    fn start() -> Self {
        let number = folder().join("display");
        let file = std::fs::File::create(&number).unwrap();
        let mut screen = Command::new("Xvfb");
        screen.args(["-displayfd", "1", "-screen", "0", "1024x768x24", "-nolisten", "tcp"]).stdout(file);
        let screen = Beside(screen.stdin(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
        let told = until("a screen", || std::fs::read_to_string(&number).ok().filter(|number| number.ends_with('\n')));
        let display = format!(":{}", told.trim());
        let environment = [format!("DISPLAY={display}"), "XDG_CURRENT_DESKTOP=GTK".into()];
        assert!(Command::new("dbus-update-activation-environment").args(&environment).status().unwrap().success());
        let store = "org.freedesktop.impl.portal.PermissionStore";
        for program in ["", "chromium", "firefox-esr", "org.chromium.Chromium", "org.mozilla.firefox"] {
            let told = Command::new("gdbus")
                .args([
                    "call",
                    "--session",
                    "--dest",
                    store,
                    "--object-path",
                    "/org/freedesktop/impl/portal/PermissionStore",
                ])
                .args(["--method", &format!("{store}.SetPermission"), "devices", "true", "camera", program, "['yes']"])
                .output()
                .unwrap();
            assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
        }
        let portal = Beside::start(
            Command::new("/usr/libexec/xdg-desktop-portal").env("DISPLAY", &display).env("XDG_CURRENT_DESKTOP", "GTK"),
        );
        let desktop = Self { display, _screen: screen, _portal: portal };
        until("the portal to see the camera", || {
            let told = Command::new("gdbus")
                .args(["call", "--session", "--dest", "org.freedesktop.portal.Desktop"])
                .args(["--object-path", "/org/freedesktop/portal/desktop"])
                .args(["--method", "org.freedesktop.DBus.Properties.Get"])
                .args(["org.freedesktop.portal.Camera", "IsCameraPresent"])
                .output()
                .unwrap();
            told.stdout.starts_with(b"(<true>").then_some(())
        });
        desktop
    }

    /// Returns the measurements of the page in a browser; restarts a browser that does not respond.
    fn page(&self, browser: impl Fn(&Path, &str) -> Command) -> Value {
        let server = TcpListener::bind("127.0.0.1:0").unwrap();
        server.set_nonblocking(true).unwrap();
        let address = format!("http://localhost:{}/", server.local_addr().unwrap().port());
        let mut stood = Vec::new();
        for _ in 0..STARTS {
            let profile = tempfile::tempdir().unwrap();
            let mut command = browser(profile.path(), &address);
            command.env("DISPLAY", &self.display).env("XDG_CURRENT_DESKTOP", "GTK").env("HOME", profile.path());
            let _browser = Beside::start(&mut command);
            stood.push("started".to_owned());
            let began = Instant::now();
            while began.elapsed() < PATIENCE {
                match server.accept() {
                    Ok((stream, _)) => match answer(stream) {
                        Some(seen) if seen["stands"].is_string() => stood.push(seen["stands"].to_string()),
                        Some(seen) => return seen,
                        None => {}
                    },
                    Err(_) => std::thread::sleep(Duration::from_millis(20)),
                }
            }
            println!("silent: {stood:?}");
        }
        panic!("the browser did not tell what it saw: {stood:?}")
    }
}

/// Serves the page, or receives its measurements.
fn answer(mut stream: std::net::TcpStream) -> Option<Value> {
    stream.set_nonblocking(false).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    let (mut request, mut length) = (String::new(), 0);
    reader.read_line(&mut request).ok()?;
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line).ok()? <= 2 {
            break;
        }
        if let Some(bytes) = line.to_lowercase().strip_prefix("content-length:") {
            length = bytes.trim().parse().unwrap();
        }
    }
    let mut body = vec![0; length];
    reader.read_exact(&mut body).ok()?;
    let page = include_str!("page.html");
    let text = if request.starts_with("GET / ") { page } else { "" };
    let head = "HTTP/1.1 200 OK\r\nContent-Type: text/html; charset=utf-8\r\nConnection: close\r\nContent-Length:";
    write!(stream, "{head} {}\r\n\r\n{text}", text.len()).ok()?;
    request.starts_with("POST").then(|| serde_json::from_slice(&body).unwrap())
}

/// Creates a recording of one picture with the patches, to be looped.
fn patches(folder: &Path) -> std::path::PathBuf {
    let row: Vec<u8> = (0..SIZE.0).flat_map(|x| PATCHES[x * PATCHES.len() / SIZE.0]).collect();
    std::fs::create_dir_all(folder.join("rgb")).unwrap();
    let mut list = String::new();
    for number in 0..30 {
        let file = std::fs::File::create(folder.join(format!("rgb/{number}.png"))).unwrap();
        let mut encoder = png::Encoder::new(file, SIZE.0 as u32, SIZE.1 as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header().unwrap().write_image_data(&row.repeat(SIZE.1)).unwrap();
        list += &format!("{:.6} rgb/{number}.png\n", f64::from(number) / 30.0);
    }
    std::fs::write(folder.join("rgb.txt"), list).unwrap();
    folder.to_owned()
}

/// Checks the camera's picture in a browser.
fn see(browser: impl Fn(&Path, &str) -> Command) {
    let recording = tempfile::tempdir().unwrap();
    let recording = patches(recording.path()).display().to_string();
    let arguments = ["stream", &recording, "--loop", "--effect", "none", "--pace", "realtime", "--on-demand"];
    let run = Run::start(&[&arguments[..], &["--to", "pipewire:Desk, blurred"]].concat());
    until("the camera", || node("desk-blurred"));
    let desktop = Desktop::start();
    let seen = desktop.page(browser);
    println!("{seen}");
    assert!(seen["cameras"].as_array().is_some_and(|cameras| cameras.contains(&"Desk, blurred".into())), "{seen}");
    assert_eq!(seen["size"], serde_json::json!([SIZE.0, SIZE.1]));
    for (told, sent) in seen["colors"].as_array().unwrap().iter().zip(PATCHES) {
        let told: Vec<u8> = serde_json::from_value(told.clone()).unwrap();
        assert!(told.iter().zip(sent).all(|(told, sent)| told.abs_diff(sent) <= NEAR), "{told:?} of {sent:?}: {seen}");
    }
    until("the browser to let go", || (state("desk-blurred")? != "running").then_some(()));
    let node = run.end()["pipewire"][0].clone();
    let given = node["shown"].as_u64().unwrap() + node["repeats"].as_u64().unwrap();
    assert!((60..=given).contains(&seen["shown"].as_u64().unwrap()), "{seen} of {node}");
}

#[test]
#[ignore = "needs browsers (crates/cli/tests/pipewire/session)"]
fn chromium_shows_the_camera_as_it_is() {
    see(|profile, address| {
        let mut chromium = Command::new("chromium");
        chromium
            .args([
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu",
                "--no-first-run",
                "--use-fake-ui-for-media-stream",
            ])
            .args(["--autoplay-policy=no-user-gesture-required", "--enable-features=WebRtcPipeWireCamera"])
            .arg(format!("--user-data-dir={}", profile.join("chromium").display()))
            .arg(address);
        chromium
    });
}

#[test]
#[ignore = "needs browsers (crates/cli/tests/pipewire/session)"]
fn firefox_shows_the_camera_as_it_is() {
    see(|profile, address| {
        let settings = [
            ("media.webrtc.camera.allow-pipewire", "true"),
            ("media.navigator.permission.disabled", "true"),
            ("media.autoplay.default", "0"),
            ("datareporting.policy.dataSubmissionEnabled", "false"),
            ("browser.shell.checkDefaultBrowser", "false"),
            // Disables welcome pages, because a hidden page gets no frames.
            ("browser.aboutwelcome.enabled", "false"),
            ("browser.startup.homepage_override.mstone", "\"ignore\""),
            ("datareporting.policy.firstRunURL", "\"\""),
            ("startup.homepage_welcome_url", "\"\""),
            // Fingerprinting protection would return noise from the canvas.
            ("privacy.resistFingerprinting", "false"),
        ];
        let lines = settings.map(|(name, value)| format!("user_pref(\"{name}\", {value});\n")).concat();
        std::fs::write(profile.join("user.js"), lines).unwrap();
        let mut firefox = Command::new("firefox-esr");
        firefox.args(["--headless", "--no-remote", "--profile"]).arg(profile).arg(address);
        firefox
    });
}
