//! A short run of the pipeline, as a process of its own, for the report: what the governor did, and how long each stage
//! took. Its pictures are dropped.

use std::io;
use std::path::Path;
use std::process::{Command, Stdio};

use bokehcam_live::v4l2::holders::list_holders;
use bokehcam_live::v4l2::node::{Kind, Node};

/// The source where no camera is free: the demonstration, with depth.
const STAND_IN: &str = "demo";

/// Runs the first free camera, or the demonstration, for ten seconds with the user's settings; returns its messages and
/// the report.
pub fn run(nodes: &[Node], config: Option<&Path>) -> String {
    let is_free = |node: &&Node| {
        let is_taken = || list_holders(&node.path).iter().any(|holder| holder.has_buffers);
        node.kind == Kind::Capture && !node.denied && node.problem.is_none() && !is_taken()
    };
    let camera = nodes.iter().find(is_free).map(|node| node.path.display().to_string());
    let source = camera.as_deref().unwrap_or(STAND_IN);
    let said = measure(source, config).unwrap_or_else(|error| format!("it cannot be run: {error}"));
    format!("bokehcam stream {source} --to null --verbose\n{said}")
}

fn measure(source: &str, config: Option<&Path>) -> io::Result<String> {
    // A camera that hangs in the kernel ends late, or never.
    let mut command = Command::new("timeout");
    command.args(["-s", "INT", "-k", "5", "10"]).arg(std::env::current_exe()?);
    command.args(["stream", source, "--to", "null", "--pace", "realtime", "--name", "doctor", "--verbose"]);
    command.args(config.map(|path| ["--config".as_ref(), path.as_os_str()]).into_iter().flatten());
    let output = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).output()?;
    Ok(String::from_utf8_lossy(&output.stderr).into_owned())
}
