//! Checks of PipeWire cameras: the daemon, the session manager, the desktop portal that browsers use, and permissions.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use serde_json::Value;

use super::finding::{Finding, PipeWireResults};
use super::system::System;
use crate::browsers::{self, Browser, Features};
use bokehcam_live::pipewire::PipeWireError;
use bokehcam_live::pipewire::graph::Graph;

pub const TOPIC: &str = "PipeWire";

/// Checks the requirements of a PipeWire camera, from the daemon to the browsers.
pub fn check_pipewire(system: &System) -> PipeWireResults {
    let graph = match Graph::list_without_modes() {
        Ok(graph) => graph,
        Err(error) => {
            let findings = vec![report_unreachable(&error)];
            return PipeWireResults { findings, can_publish: false, cameras: Vec::new() };
        }
    };
    let all: Vec<_> = graph.sources.iter().filter(|source| source.is_camera).collect();
    let cameras: Vec<&str> = all.iter().map(|camera| camera.label.as_str()).collect();
    let there_are = if cameras.is_empty() { "no camera yet".to_owned() } else { cameras.join(", ") };
    let mut findings = vec![Finding::good(TOPIC, format!("it is running, with {there_are}; --to pipewire adds one"))];
    let has_manager = graph.has_session_manager();
    findings.push(if has_manager {
        Finding::good(TOPIC, "a session manager connects readers with cameras")
    } else {
        let fix = "install and start it: `sudo apt install wireplumber`, `systemctl --user start wireplumber`";
        Finding::missing(TOPIC, "no session manager: readers would wait forever", fix)
    });
    findings.push(if system.portal {
        Finding::good(TOPIC, "a desktop portal is running (browsers need it for cameras)")
    } else {
        let fix =
            "install xdg-desktop-portal and the part for this desktop (-gtk, -gnome, -kde, -wlr), and log in again";
        Finding::note(TOPIC, "no desktop portal: browsers do not list PipeWire cameras; other programs do", fix)
    });
    // A portal that started before the session manager never sees its cameras.
    if system.portal && !cameras.is_empty() && portal_sees_a_camera() == Some(false) {
        let fix = "restart both in order: `systemctl --user restart wireplumber xdg-desktop-portal`";
        findings.push(Finding::note(TOPIC, "the desktop portal sees no camera, although PipeWire has one", fix));
    }
    findings.extend(check_refusals());
    findings.extend(check_browsers());
    let readable = all.iter().filter(|camera| has_manager && !camera.process.is_some_and(is_bokehcam));
    PipeWireResults {
        can_publish: has_manager,
        cameras: readable.map(|camera| camera.label.clone()).collect(),
        findings,
    }
}

/// Reports which browsers list PipeWire's cameras by a flags file, and which need a change of their settings.
fn check_browsers() -> Vec<Finding> {
    let change = |name: &str, switch: String| {
        Finding::note(TOPIC, format!("{name} lists PipeWire cameras only after a change of its settings"), switch)
    };
    let chromium = browsers::find_browsers().into_iter().map(|Browser { name, flags_file }| {
        let is_on = |file: &PathBuf| browsers::read_features(file).is_ok_and(|on| on == Features::PipeWireCamera);
        match flags_file.filter(is_on) {
            Some(file) => {
                Finding::good(TOPIC, format!("{name}: PipeWire cameras are on by {}", browsers::shorten(&file)))
            }
            None => change(name, format!("{} (or {}), then start it again", browsers::SETTING, browsers::FLAG)),
        }
    });
    let firefox = ["firefox", "firefox-esr"].iter().find_map(|name| browsers::find_program(name));
    let firefox =
        firefox.map(|_| change("Firefox", "about:config, media.webrtc.camera.allow-pipewire = true".to_owned()));
    chromium.chain(firefox).collect()
}

/// Whether a process is an instance of this program: its output does not count as a camera.
fn is_bokehcam(process: u32) -> bool {
    std::fs::read_to_string(format!("/proc/{process}/comm")).is_ok_and(|name| name.trim_end() == "bokehcam")
}

fn report_unreachable(error: &PipeWireError) -> Finding {
    let fix = "it is only needed for --to pipewire: `sudo apt install pipewire wireplumber`, then `systemctl --user \
               start pipewire wireplumber`";
    let found = match error {
        PipeWireError::NoDaemon { socket } => format!("it does not run: nothing answers at {socket}"),
        error => error.to_string(),
    };
    Finding::note(TOPIC, found, fix)
}

/// Whether the portal reports a camera; `None` if it does not answer.
fn portal_sees_a_camera() -> Option<bool> {
    let camera = ["org.freedesktop.portal.Camera", "IsCameraPresent"];
    let place = ["get-property", "org.freedesktop.portal.Desktop", "/org/freedesktop/portal/desktop"];
    call_bus(&[&place[..], &camera].concat())?["data"].as_bool()
}

/// Reports programs whose camera access was once denied; the portal never asks about them again.
fn check_refusals() -> Option<Finding> {
    let store = "org.freedesktop.impl.portal.PermissionStore";
    let place = ["call", store, "/org/freedesktop/impl/portal/PermissionStore", store, "Lookup", "ss"];
    let names = parse_refused_programs(&call_bus(&[&place[..], &["devices", "camera"]].concat())?);
    (!names.is_empty()).then(|| {
        let found = format!("the desktop refuses cameras to {}, because of an earlier answer", names.join(", "));
        Finding::note(TOPIC, found, "`flatpak permission-remove devices camera`, and answer yes the next time")
    })
}

/// Returns the programs with the answer "no" in the permission store; programs outside sandboxes have an empty name.
fn parse_refused_programs(answer: &Value) -> Vec<String> {
    let permissions = answer["data"][0].as_object().into_iter().flatten();
    let is_refused = |answers: &Value| answers.as_array().is_some_and(|list| list.iter().any(|word| word == "no"));
    let no = permissions.filter(|(_, answers)| is_refused(answers));
    no.map(|(name, _)| if name.is_empty() { "all programs outside of sandboxes".into() } else { name.clone() })
        .collect()
}

/// Calls a running service on the session bus without starting it; `None` if the call fails.
fn call_bus(question: &[&str]) -> Option<Value> {
    let output = Command::new("busctl")
        .args(["--user", "--auto-start=no", "--timeout=3", "--json=short"])
        .args(question)
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output();
    serde_json::from_slice(&output.ok().filter(|answer| answer.status.success())?.stdout).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_was_refused_is_named() {
        let answer = r#"{"type":"a{sas}v","data":[{"":["no"],"org.a":["yes"],"org.b":["no"]},{"type":"y","data":0}]}"#;
        let expected = ["all programs outside of sandboxes", "org.b"];
        assert_eq!(parse_refused_programs(&serde_json::from_str(answer).unwrap()), expected);
        assert_eq!(parse_refused_programs(&serde_json::json!({ "data": [{}] })), Vec::<String>::new());
        assert_eq!(parse_refused_programs(&Value::Null), Vec::<String>::new());
    }
}
