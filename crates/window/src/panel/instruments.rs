//! The instruments overlay at the top left: times, rates and drops.

use std::fmt::Write;
use std::time::Duration;

use egui::text::LayoutJob;
use egui::{Align, Align2, Area, Context, Id, Mesh, Order, Rect, RichText, Sense, Shape, Stroke, TextStyle, Theme, Ui};
use egui::{pos2, vec2};

use super::cards;
use super::meters::{GRAPH_FRAMES, Summary};
use super::state::{Source, State};
use super::theme::{Colors, GAP, PAD, medium_font, quality_color};
use crate::texts::{format_number, tr, tr_with};
use bokehcam::budget::Quality;

const WIDTH: f32 = 286.0;
/// Height of the graph, in points.
const GRAPH_HEIGHT: f32 = 74.0;
/// Seconds between updates of the numbers; faster updates would be unreadable.
const UPDATE_PERIOD_S: f64 = 0.2;

/// Cached summary, so that it is not recomputed in every pass.
#[derive(Default)]
pub struct Instruments {
    summary: Summary,
    at_s: f64,
}

impl Instruments {
    /// Draws the instruments.
    pub fn show(&mut self, ctx: &Context, state: &State) {
        let now_s = ctx.input(|input| input.time);
        if now_s - self.at_s >= UPDATE_PERIOD_S || self.summary == Summary::default() {
            (self.summary, self.at_s) = (state.meters.summary(), now_s);
        }
        ctx.request_repaint_after(Duration::from_millis(200));
        let window = super::dock::picture_area(ctx);
        let area = Area::new(Id::unique("instruments")).fixed_pos(window.min + vec2(GAP, GAP)).order(Order::Middle);
        cards::show(ctx, area.interactable(false), WIDTH, PAD, |ui, _| {
            ui.set_width(ui.available_width());
            ui.spacing_mut().item_spacing.y = 3.0;
            self.add_rows(ui, state);
        });
    }

    /// Adds the frame rate and quality level, the graph, and one row per number.
    fn add_rows(&self, ui: &mut Ui, state: &State) {
        let colors = Colors::for_ui(ui);
        let (budget_ms, executor) = match &state.source {
            Source::Running(running) => (running.budget_ns as f32 / 1e6, running.executor.as_str()),
            Source::Opening | Source::Lost(_) | Source::Ended => (0.0, ""),
        };
        let Summary { fps, latency_ms: [p50, p99], reaction_ms } = self.summary;
        ui.horizontal(|ui| {
            ui.label(RichText::new(format_number(fps, 1)).family(medium_font()).size(22.0));
            ui.label(RichText::new("fps").color(colors.weak));
            ui.with_layout(egui::Layout::right_to_left(Align::Center), |ui| {
                let last = state.meters.samples().last().and_then(|bar| bar.quality);
                let (color, letter) = quality_color(last, active_theme(ui));
                let name = last.map_or(tr("no blur"), Quality::name);
                ui.label(RichText::new(format!("{letter} {name}")).color(color).family(medium_font()));
            });
        });
        draw_graph(ui, state, budget_ms);
        add_row(ui, "Latency", &format!("{p50:.0} ms, p99 {p99:.0} ms"));
        if reaction_ms[1] > 0.0 {
            add_row(ui, "Input to picture", &format!("{:.0} ms, p99 {:.0} ms", reaction_ms[0], reaction_ms[1]));
        }
        add_row(ui, "Dropped", &format_drops(state));
        let stages = &state.meters.stages;
        add_row(ui, "Decode", &format_ms(stages.decode_ms));
        // A separate text per ordinal, for the translations.
        let depth = match stages.depth_interval() {
            1 => format_ms(stages.depth_ms),
            2 => tr_with("{}, every 2nd frame", &[&format_ms(stages.depth_ms)]),
            3 => tr_with("{}, every 3rd frame", &[&format_ms(stages.depth_ms)]),
            every => tr_with("{}, every {}th frame", &[&format_ms(stages.depth_ms), &every]),
        };
        add_row(ui, "Depth", &depth);
        add_row(ui, "Blur", &format_ms(stages.blur_ms));
        for &(name, pass_ms) in &stages.passes {
            add_row(ui, &format!("     {name}"), &format_ms(pass_ms));
        }
        add_row(ui, "Between stages", &format_ms(stages.queueing_ms));
        add_row(ui, "Play-out delay", &format_ms(stages.playout_ms));
        add_row(ui, "Present", &format_ms(stages.present_ms));
        if !executor.is_empty() {
            ui.add(egui::Label::new(RichText::new(executor).text_style(TextStyle::Small).color(colors.weak)).wrap());
        }
    }
}

fn active_theme(ui: &Ui) -> Theme {
    if ui.visuals().dark_mode { Theme::Dark } else { Theme::Light }
}

fn format_ms(ms: f64) -> String {
    format!("{} ms", format_number(ms, 1))
}

/// Adds a name and a right-aligned value, which wraps if needed.
fn add_row(ui: &mut Ui, name: &str, value: &str) {
    let colors = Colors::for_ui(ui);
    let (font, width) = (TextStyle::Small.resolve(ui.style()), ui.available_width());
    let name = ui.painter().layout_no_wrap(tr(name).to_owned(), font.clone(), colors.weak);
    let mut job = LayoutJob::simple(value.to_owned(), font, colors.text, (width - name.size().x - GAP).max(0.0));
    job.halign = Align::RIGHT;
    let value = ui.painter().layout_job(job);
    let (rect, _) = ui.allocate_exact_size(vec2(width, value.size().y.max(16.0)), Sense::hover());
    let top = rect.top() + 0.5 * (16.0 - name.size().y);
    ui.painter().galley(pos2(rect.left(), top), name, colors.weak);
    ui.painter().galley(pos2(rect.right(), top), value, colors.text);
}

/// Formats the dropped frames by cause, without the causes that have none.
fn format_drops(state: &State) -> String {
    let frames = &state.meters.frames;
    let total = frames.dropped.total();
    if total == 0 {
        return tr_with("none of {}", &[&frames.captured]);
    }
    let mut text = tr_with("{} of {}:", &[&total, &frames.captured]);
    for (cause, count) in frames.dropped.by_cause().into_iter().filter(|(_, count)| *count > 0) {
        // Writing to a string does not fail.
        let _ = write!(text, " {count} {cause}");
    }
    text
}

/// Draws the graph: one bar per recent frame for its blur time, coloured by quality level, a letter below each run of
/// frames at the same level, and a line at the budget.
fn draw_graph(ui: &mut Ui, state: &State, budget_ms: f32) {
    let colors = Colors::for_ui(ui);
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), GRAPH_HEIGHT + 16.0), Sense::hover());
    let plot = Rect::from_min_max(rect.min, pos2(rect.right(), rect.top() + GRAPH_HEIGHT));
    let painter = ui.painter().with_clip_rect(rect);
    painter.rect_filled(plot, egui::CornerRadius::same(6), colors.field);
    let longest_ms = state.meters.samples().map(|bar| bar.blur_ms).fold(0.0, f32::max);
    // Fits the budget and all bars, but a rare bar above three budgets must not flatten the others.
    let top_ms = (1.35 * budget_ms).max(longest_ms.min(3.0 * budget_ms.max(1.0)) * 1.1).max(1.0);
    let step = plot.width() / GRAPH_FRAMES as f32;
    let bar_count = state.meters.samples().len();
    let theme = active_theme(ui);
    let mut mesh = Mesh::default();
    // Quality level of the current run of bars, and the x where the run begins.
    let mut run: Option<(Option<Quality>, f32)> = None;
    let font = egui::FontId::new(11.0, medium_font());
    let draw_letter = |quality: Option<Quality>, from: f32, to: f32| {
        // Letters are wider than short runs and would overlap.
        if to - from >= 9.0 {
            let (color, letter) = quality_color(quality, theme);
            painter.text(
                pos2((from + to) / 2.0, plot.bottom() + 8.0),
                Align2::CENTER_CENTER,
                letter,
                font.clone(),
                color,
            );
        }
    };
    let mut x = plot.right() - bar_count as f32 * step;
    for bar in state.meters.samples() {
        let height = (bar.blur_ms / top_ms).min(1.0) * plot.height();
        let at = Rect::from_min_max(pos2(x, plot.bottom() - height), pos2(x + step, plot.bottom()));
        mesh.add_colored_rect(at, quality_color(bar.quality, theme).0);
        match run {
            Some((quality, from)) if quality != bar.quality => {
                draw_letter(quality, from, x);
                run = Some((bar.quality, x));
            }
            Some(_) => {}
            None => run = Some((bar.quality, x)),
        }
        x += step;
    }
    painter.add(Shape::mesh(mesh));
    if let Some((quality, from)) = run {
        draw_letter(quality, from, x);
    }
    if budget_ms > 0.0 {
        let y = plot.bottom() - budget_ms / top_ms * plot.height();
        let ends = [pos2(plot.left(), y), pos2(plot.right(), y)];
        painter.extend(Shape::dashed_line(&ends, Stroke::new(1.5, colors.text), 5.0, 4.0));
        let text = tr_with("budget {}", &[&format_ms(budget_ms.into())]);
        let small = egui::FontId::new(11.0, egui::FontFamily::Proportional);
        painter.text(pos2(plot.left() + 5.0, y - 2.0), Align2::LEFT_BOTTOM, text, small, colors.text);
    }
}
