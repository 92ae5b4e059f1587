//! Control of a preview by others: what they ask goes to the window's thread, which answers.

use std::path::PathBuf;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::sync::{Arc, PoisonError};
use std::time::Duration;

use super::session::CurrentRelease;
use crate::state::{Running, Way};
use bokehcam::control::{Answer, Claim, Request, Server, Status};
use bokehcam::look::{Look, Patch};

/// How long the window, and who saves pictures, may take to answer.
const PATIENCE: Duration = Duration::from_secs(3);

/// What the window is asked for.
pub enum Wish {
    /// How it is.
    Status,
    /// Show pictures, or the still card in their place.
    On(bool),
    /// One or the other.
    Toggle,
    /// Another look.
    Look(Patch),
    /// Depth made another way.
    Depth(Way),
    /// A snapshot, in this file or where they usually go.
    Snapshot(Option<PathBuf>),
}

/// What a request means; an error is its answer.
pub type Understand = dyn Fn(Request) -> Result<Wish, Answer> + Send + Sync;

/// Whether a change of a look can be while this source runs, and what of it has no effect; an error is its answer.
pub type Judge = dyn Fn(&Patch, &Look, &Running) -> Result<Option<String>, Answer>;

/// The name of a preview, and what it understands.
pub struct Control {
    /// Its name.
    pub claim: Claim,
    /// What requests mean: parsed as the command line is.
    pub understand: Box<Understand>,
    /// Which changes of the look can be.
    pub judge: Box<Judge>,
}

/// Somebody who waits for an answer.
pub struct Asked {
    /// What for.
    pub wish: Wish,
    /// Takes the answer; whoever gave up waiting takes none.
    pub answer: SyncSender<Answer>,
}

impl Control {
    /// Listens from now on. `wake` is called when somebody asks. That outputs were switched off is answered once they show
    /// the card, which `release` knows.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn begin(
        self,
        release: CurrentRelease,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> std::io::Result<(Server, Receiver<Asked>, Box<Judge>)> {
        let (ask, asked) = mpsc::channel();
        let understand = self.understand;
        let server = self.claim.serve(Arc::new(move |request| {
            let wish = match understand(request) {
                Ok(wish) => wish,
                Err(answer) => return answer,
            };
            let switches = matches!(wish, Wish::On(_) | Wish::Toggle);
            let (answer, answered) = mpsc::sync_channel(1);
            if ask.send(Asked { wish, answer }).is_err() {
                return Answer::failed("the window is closed");
            }
            wake();
            match answered.recv_timeout(PATIENCE) {
                Ok(Answer::Done { status, .. }) if switches && !status.on => covered(&release, status),
                Ok(answer) => answer,
                Err(_) => Answer::failed("the window does not answer in time"),
            }
        }))?;
        Ok((server, asked, self.judge))
    }
}

/// The answer once the outputs show the card.
fn covered(release: &CurrentRelease, status: Box<Status>) -> Answer {
    let release = release.lock().unwrap_or_else(PoisonError::into_inner).clone();
    match release.map_or(Ok(None), |release| release.wait_covered()) {
        Ok(note) => Answer::Done { status, note },
        Err(error) => Answer::failed(error.to_string()),
    }
}
