//! `models`: the networks that are known, and those that are installed.

use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use crate::cli::error::CliError;
use crate::cli::terminal::{print, say};
use crate::files::{input, whole};
use crate::network::{self, KNOWN, Known};

/// List the networks that give one camera depth, and install them
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam models                                            which are known, which are installed, where to get them
  bokehcam models add selfie_segmentation_landscape.onnx     checks the file and installs it for this user

Nothing is downloaded: get a file with your browser, then add it.")]
pub struct ModelsCommand {
    #[command(subcommand)]
    what: Option<What>,
}

#[derive(Subcommand, Debug)]
enum What {
    /// List them, as does `models` alone
    List,
    /// Check that files are networks that are known, and copy them to where these are looked for
    #[command(alias = "install", after_help = "Example:\n  bokehcam models add selfie_segmentation_landscape.onnx")]
    Add {
        /// The files, .onnx
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
    },
}

/// Runs the command.
///
/// # Errors
/// The file is no network that is known, or cannot be copied.
pub fn run(command: &ModelsCommand) -> Result<(), CliError> {
    match &command.what {
        None | Some(What::List) => print(listed().as_bytes()),
        Some(What::Add { files }) => files.iter().try_for_each(|file| add(file)),
    }
}

fn listed() -> String {
    let installed = network::installed();
    let mut text = String::from("known networks, the best of each task first:\n");
    for known in &KNOWN {
        let place = installed.iter().find(|(other, _)| std::ptr::eq(*other, known));
        let place = place.map_or("not installed".to_owned(), |(_, file)| file.display().to_string());
        let Known { name, task, license, address, sha256, bytes, .. } = known;
        let kilobytes = bytes.div_ceil(1000);
        text += &format!(
            "\n{name}\n  for      --depth {task}: {}\n  here     {place}\n  licence  {license}\n  get      {address}\n  file     \
             {kilobytes} kB, SHA-256 {sha256}\n",
            crate::names::Named::help(*task).to_lowercase(),
            task = task.name(),
        );
    }
    let folders: Vec<String> = network::folders().iter().map(|folder| folder.display().to_string()).collect();
    text += &format!("\nlooked for in {}\n", folders.join(", "));
    match network::onnx_runtime_installed() {
        Ok(name) => text += &format!("run by {name}\n"),
        Err(why) => text += &format!("run by what is built in; 1.5 to 3 times as fast with ONNX Runtime: {why}\n"),
    }
    text
}

fn add(file: &Path) -> Result<(), CliError> {
    if file.to_str().is_some_and(|name| name.contains("://")) {
        let what = "nothing is downloaded: get the file with your browser, then `bokehcam models add FILE`";
        return Err(CliError::Usage(format!("{}: {what}", file.display())));
    }
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source: io::Error| CliError::Io { path, source }
    };
    let bytes = input::read(file, network::MOST_BYTES).map_err(failed(file))?;
    let known = Known::of(&bytes).ok_or_else(|| {
        let what = "it is none of the networks that are known (`bokehcam models` lists them), or not whole: one of your own is \
                    used from where it is, by --depth matte:FILE or mono:FILE";
        failed(file)(io::Error::new(io::ErrorKind::InvalidData, what))
    })?;
    let no_home = || CliError::Usage("there is no home folder to install it in: set HOME or XDG_DATA_HOME".to_owned());
    let folder = network::folders().into_iter().next().ok_or_else(no_home)?;
    let target = folder.join(known.file_name());
    std::fs::create_dir_all(&folder).map_err(failed(&folder))?;
    match input::read(&target, network::MOST_BYTES) {
        Ok(there) if there == bytes => {}
        Ok(_) => {
            let what = "another file is there under this name: move it away";
            return Err(failed(&target)(io::Error::new(io::ErrorKind::AlreadyExists, what)));
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            whole::write(&target, &bytes, false).map_err(failed(&target))?;
        }
        Err(error) => return Err(failed(&target)(error)),
    }
    say(&format!("{}: installed as {}, for --depth {}", known.name, target.display(), known.task.name()));
    Ok(())
}
