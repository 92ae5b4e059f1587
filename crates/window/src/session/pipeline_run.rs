//! One run of the pipeline.

use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use super::super::services::{OpenedSource, Services};
use super::super::state::{Running, Source};
use super::outputs::Outputs;
use super::{EventSender, SessionConfig, SessionEvent};
use bokehcam::depth::plate::Guide;
use bokehcam::link;
use bokehcam::look::{Look, LookFacts};
use bokehcam_live::pipeline::{self, BlurSetup, ChangeSender, Destination, Pace, PipelineError, Run};
use bokehcam_live::source::{Kind, SourceName};
use bokehcam_live::stats::Report;

/// A running pipeline, and the handles that control it.
pub(super) struct PipelineRun {
    /// What its source allows a look.
    pub facts: LookFacts,
    changes: ChangeSender,
    stop: Arc<AtomicBool>,
    /// Progress of the background plate, if depth comes from it.
    pub guide: Option<Arc<Guide>>,
    thread: JoinHandle<Option<Report>>,
}

/// The pipeline adapts the quality level to real time, because the window is live.
const ADAPTIVE_QUALITY: bool = true;

impl PipelineRun {
    /// Starts a run into these outputs. `ended` is called once with its result.
    ///
    /// # Errors
    /// Returns a one-line message if the executor or the thread cannot be created.
    pub(super) fn start(
        opened: OpenedSource,
        config: &mut SessionConfig,
        events: &EventSender,
        outputs: &mut Outputs,
        ended: impl FnOnce(Result<Report, PipelineError>) + Send + 'static,
    ) -> Result<(Self, Source), String> {
        let OpenedSource { name, mut source, has_depth, depth_methods, depth_method, camera, .. } = opened;
        let (info, seeker) = (source.camera.info(), source.camera.seeker());
        let (guide, depth_from) = (source.guide.clone(), source.depth_from);
        let kind = SourceName::from_str(&name).map_or(Kind::default(), |name| name.kind());
        let is_for_call = outputs.has_virtual_camera() || config.outputs.iter().any(|output| output.is_camera);
        let facts =
            LookFacts { has_depth, metres: camera.metres, size: info.size, is_for_call, ..LookFacts::default() };
        let look = config.look.for_source(&facts);
        let (blurring, changes) = BlurSetup::create(look, (info.size, ADAPTIVE_QUALITY), |settings| {
            config.services.create_executor(settings, info.size)
        })?;
        let running = Running {
            name,
            label: info.name,
            size: info.size,
            period_ns: info.period_ns,
            has_depth,
            kind,
            depth_from,
            depth_methods,
            depth_method,
            executor: blurring.bokeh.as_ref().map_or_else(|| "no blur".into(), |bokeh| bokeh.describe()),
        };
        let (budget_ns, threads) = (config.budget_ns.unwrap_or(info.period_ns), config.threads);
        let sink = outputs.begin_source(info.size, info.period_ns);
        let (view, views) = link::live();
        let stop = Arc::new(AtomicBool::new(false));
        let (stopped, wake, keep_going) = (Arc::clone(&stop), Arc::clone(&events.wake), config.keep_going);
        let (output_request, demand) = (Arc::clone(&config.output_request), config.demand.clone());
        // Before the thread starts, so that the window can receive the first frame.
        events.send(SessionEvent::RunStarted(views, guide.clone(), seeker));
        let thread = thread::Builder::new().name("pipeline".into()).spawn(move || {
            let result = pipeline::run(Run {
                threads,
                pace: Pace::Realtime,
                budget_ns,
                keep_going,
                demand: Some(demand),
                output_request: Some(output_request),
                view: Some(view),
                progress: &|_| wake(),
                ..source.into_run(blurring, Destination::Lent(&mut *sink.lock()), &stopped)
            });
            let report = match &result {
                Ok(report) => report.clone(),
                Err(failed) => (*failed.report).clone(),
            };
            ended(result);
            Some(report)
        });
        let thread = thread.map_err(|error| format!("cannot start the pipeline's thread: {error}"))?;
        let pipeline_run = Self { facts, changes, stop, guide, thread };
        Ok((pipeline_run, Source::Running(running)))
    }

    /// Blurs with this look from now on, which must [suit](Look::for_source) the source; its frames carry `number`.
    ///
    /// # Errors
    /// Returns a one-line message if the executor cannot be created. The previous look stays active.
    pub(super) fn switch_look(&mut self, look: Look, number: u64, services: &mut dyn Services) -> Result<(), String> {
        let size = self.facts.size;
        self.changes.switch_look(look, number, |settings| {
            let began = Instant::now();
            let bokeh = services.create_executor(settings, size)?;
            tracing::debug!("an executor was made in {:?}", began.elapsed());
            Ok(bokeh)
        })
    }

    /// Stops the run and waits for it. Returns its report.
    pub(super) fn stop(self) -> Option<Report> {
        self.stop.store(true, Ordering::Relaxed);
        self.join()
    }

    /// Waits for a run that has ended or been stopped.
    pub(super) fn join(self) -> Option<Report> {
        self.thread.join().ok().flatten()
    }
}
