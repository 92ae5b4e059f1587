//! `models`: lists known and installed networks, and installs them.

use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::{Args, Subcommand};

use crate::error::CliError;
use crate::log;
use crate::terminal::{print_to_stderr, print_to_stdout};
use bokehcam_files::{atomic_file, input};
use bokehcam_live::source::installed::{installed_networks, model_folders};
use bokehcam_networks::network::{KNOWN_NETWORKS, KnownNetwork, MAX_BYTES};

/// List the networks that find depth in pictures of a single camera, and install them
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam models                                            lists the known networks: which are installed, where to get the others
  bokehcam models get                                        downloads the one that finds persons, with curl or wget
  bokehcam models add selfie_segmentation_landscape.tflite   checks a local file, and installs it for this user

Only `get` uses the internet, and it shows its command before running it.")]
pub struct ModelsCommand {
    #[command(subcommand)]
    what: Option<What>,
}

#[derive(Subcommand, Debug)]
enum What {
    /// List them; `models` alone does the same
    List,
    /// Check that files are known networks, and copy them to the folder of installed networks
    #[command(alias = "install", after_help = "Example:\n  bokehcam models add selfie_segmentation_landscape.tflite")]
    Add {
        /// The files, .tflite or .onnx
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
    },
    /// Download a known network with curl or wget, verify it, and install it for this user
    #[command(alias = "fetch", after_help = "Example:\n  bokehcam models get tcmonodepth-small")]
    Get {
        /// Name of the network [default: the fastest one that finds persons]
        name: Option<String>,
    },
}

/// Runs the command.
///
/// # Errors
/// Fails if the file is not a known network, or cannot be copied.
pub fn run(command: &ModelsCommand) -> Result<(), CliError> {
    match &command.what {
        None | Some(What::List) => print_to_stdout(format_list().as_bytes()),
        Some(What::Add { files }) => files.iter().try_for_each(|file| add_file(file)),
        Some(What::Get { name }) => fetch(name.as_deref()),
    }
}

fn format_list() -> String {
    let installed = installed_networks();
    let mut text = String::from("known networks, the best of each task first:\n");
    for known in &KNOWN_NETWORKS {
        let place = installed.iter().find(|(other, _)| std::ptr::eq(*other, known));
        let place = place.map_or("not installed".to_owned(), |(_, at)| at.display().to_string());
        let KnownNetwork { file, task, license, address, sha256, bytes, .. } = known;
        let kilobytes = bytes.div_ceil(1000);
        text += &format!(
            "\n{file}\n  for      --depth {task}: {}\n  here     {place}\n  licence  {license}\n  get      {address}\n  file     \
             {kilobytes} kB, SHA-256 {sha256}\n",
            bokehcam::names::Named::help(*task).to_lowercase(),
            task = task.name(),
        );
    }
    let folders: Vec<String> = model_folders().iter().map(|folder| folder.display().to_string()).collect();
    text += &format!("\nlooked for in {}\n", folders.join(", "));
    text + ".tflite runs on bokehcam's own runtime, .onnx on rten\n"
}

fn add_file(file: &Path) -> Result<(), CliError> {
    if file.to_str().is_some_and(|name| name.contains("://")) {
        let what = "there is no such file: `bokehcam models get NAME` fetches a known network";
        return Err(CliError::Usage(format!("{}: {what}", file.display())));
    }
    let bytes = input::read(file, MAX_BYTES).map_err(CliError::io(file))?;
    let known = KnownNetwork::identify(&bytes).ok_or_else(|| {
        let what = "it is not a known network (`bokehcam models` lists them), or is incomplete; your own network needs \
                    no installation: use --depth matte:FILE or mono:FILE";
        CliError::io(file)(io::Error::new(io::ErrorKind::InvalidData, what))
    })?;
    install(known, &bytes)
}

/// Writes a network into this user's folder; an existing file is kept.
fn install(known: &KnownNetwork, bytes: &[u8]) -> Result<(), CliError> {
    let no_home = || CliError::Usage("there is no home folder to install it in: set HOME or XDG_DATA_HOME".to_owned());
    let folder = model_folders().into_iter().next().ok_or_else(no_home)?;
    let target = folder.join(known.file);
    std::fs::create_dir_all(&folder).map_err(CliError::io(&folder))?;
    match input::read(&target, MAX_BYTES) {
        Ok(there) if there == bytes => {}
        Ok(_) => {
            let what = "there is another file of this name: move it away";
            return Err(CliError::io(&target)(io::Error::new(io::ErrorKind::AlreadyExists, what)));
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            atomic_file::write(&target, bytes, false).map_err(CliError::io(&target))?;
        }
        Err(error) => return Err(CliError::io(&target)(error)),
    }
    print_to_stderr(&format!("{}: installed as {}, for --depth {}", known.file, target.display(), known.task.name()));
    Ok(())
}

/// Downloads a known network and installs it.
fn fetch(name: Option<&str>) -> Result<(), CliError> {
    let unknown = |name: &str| {
        let names: Vec<&str> = KNOWN_NETWORKS.iter().map(|known| known.file).collect();
        CliError::Usage(format!("there is no network {name:?}: use one of {}", names.join(", ")))
    };
    let known =
        name.map_or(Ok(&KNOWN_NETWORKS[0]), |name| KnownNetwork::find_by_name(name).ok_or_else(|| unknown(name)))?;
    if let Some((_, file)) = installed_networks().iter().find(|(other, _)| std::ptr::eq(*other, known)) {
        print_to_stderr(&format!("{}: installed already, as {}", known.file, file.display()));
        return Ok(());
    }
    let bytes = download(known)?;
    let is_whole = KnownNetwork::identify(&bytes).is_some_and(|found| std::ptr::eq(found, known));
    if !is_whole {
        let what =
            format!("the download is not {}, and was discarded: {} bytes of {}", known.file, bytes.len(), known.bytes);
        return Err(CliError::io(Path::new(known.address))(io::Error::new(io::ErrorKind::InvalidData, what)));
    }
    install(known, &bytes)
}

/// Downloads a network from its address; at most one byte more than its known size, to detect a longer file.
fn download(known: &KnownNetwork) -> Result<Vec<u8>, CliError> {
    const CLIENTS: [(&str, &[&str]); 2] = [
        ("curl", &["--fail", "--location", "--silent", "--show-error", "--proto", "=https", "--max-time", "300"]),
        ("wget", &["--https-only", "--no-verbose", "--timeout=60", "--output-document=-"]),
    ];
    let address = || CliError::io(Path::new(known.address));
    for (client, options) in CLIENTS {
        print_to_stderr(&format!("{client} {} {}", options.join(" "), known.address));
        // Before what the client itself says.
        log::flush();
        let mut command = Command::new(client);
        command.args(options).arg(known.address).stdin(Stdio::null()).stdout(Stdio::piped());
        let mut child = match command.spawn() {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                print_to_stderr(&format!("{client} is not installed"));
                continue;
            }
            child => child.map_err(address())?,
        };
        let mut bytes = Vec::new();
        let read = child.stdout.take().map_or(Ok(0), |out| out.take(known.bytes + 1).read_to_end(&mut bytes));
        let status = child.wait().map_err(address())?;
        read.map_err(address())?;
        // A client that is cut off at the limit fails, too; the caller then reports the wrong content instead.
        return match bytes.len() as u64 <= known.bytes && !status.success() {
            true => Err(address()(io::Error::other(format!(
                "{client} failed ({status}): or download the file in a browser, then `bokehcam models add FILE`"
            )))),
            false => Ok(bytes),
        };
    }
    let what = format!(
        "neither curl nor wget is installed: download {} in a browser, then `bokehcam models add FILE`",
        known.address
    );
    Err(CliError::Usage(what))
}
