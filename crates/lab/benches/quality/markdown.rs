//! Tables for the documentation, and the verdict on the targets.

use std::fmt::Write;

use bokehcam::budget::Quality;

use super::masks::Portrait;
use super::methods::Method;
use super::report::{Case, Flicker, Record, Results};

/// PSNR at an error of one code value (RMS): better results count as this in the verdict, as the difference is
/// invisible.
const ONE_CODE_DB: f64 = 48.13;
/// The targets, in dB unless the name has another unit.
const ABOVE_GATHER_DB: f64 = 4.0;
const ABOVE_BEST_RIVAL_DB: f64 = 1.0;
const BELOW_RIVAL_DB: f64 = 0.3;
const LOWEST_PERCENT: f64 = -2.0;

const BALANCED: Method = Method::Layered(Quality::Balanced);
const BEST: Method = Method::Layered(Quality::Best);

/// Returns all tables and the verdict.
pub fn format_report(results: &Results) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_tables(results, &mut text);
    let _ = write_portraits(results, &mut text);
    let _ = write_situations(results, &mut text);
    for method in [BALANCED, BEST, Method::Refined] {
        let _ = write_verdict(results, method, &mut text);
    }
    text
}

fn format_cell(record: Option<&Record>) -> String {
    let Some(record) = record else { return "-".to_owned() };
    let edge = record.edge_db.map_or("-".to_owned(), |edge_db| format!("{edge_db:.1}"));
    format!("{:.2} / {edge} / {:.4} / {:.4}", record.psnr_db, record.ssim, record.flip)
}

fn write_portraits(results: &Results, text: &mut String) -> std::fmt::Result {
    if results.portraits.is_empty() {
        return Ok(());
    }
    writeln!(text, "## Portraits from a mask\n")?;
    writeln!(text, "| scene | way | share error | flicker | PSNR dB | edge dB |\n|---|---|---|---|---|---|")?;
    for portrait in &results.portraits {
        let Portrait { scene, method, share_error, share_flicker, psnr_db, edge_db } = portrait;
        writeln!(text, "| {scene} | {method} | {share_error:.1} | {share_flicker:.1} | {psnr_db:.2} | {edge_db:.2} |")?;
    }
    writeln!(text)
}

fn write_situations(results: &Results, text: &mut String) -> std::fmt::Result {
    use super::situations::Outcome;
    if results.situations.is_empty() {
        return Ok(());
    }
    writeln!(text, "## What is hard for one camera\n")?;
    writeln!(text, "| situation | source | missed % | mistaken % | PSNR dB | edge dB |\n|---|---|---|---|---|---|")?;
    for outcome in &results.situations {
        let Outcome { situation, source, missed, mistaken, psnr_db, edge_db } = outcome;
        writeln!(text, "| {situation} | {source} | {missed:.2} | {mistaken:.2} | {psnr_db:.1} | {edge_db:.1} |")?;
    }
    writeln!(text)
}

fn write_tables(results: &Results, text: &mut String) -> std::fmt::Result {
    for (damaged, title) in [(false, "Exact depth"), (true, "Damaged depth")] {
        let cases = results.cases(damaged);
        if cases.is_empty() {
            continue;
        }
        writeln!(text, "## {title}\n\nEach cell: PSNR dB / edge dB / SSIM / FLIP.\n")?;
        writeln!(text, "| scene | gather | best rival | balanced | best | refined |\n|---|---|---|---|---|---|")?;
        for &case in &cases {
            let rival = results.best_rival(case);
            let scene = case.1.map_or(case.0.to_owned(), |damage| format!("{}, {damage}", case.0));
            let rival =
                rival.map_or("-".to_owned(), |rival| format!("{} ({})", format_cell(Some(rival)), rival.method));
            let [gather, balanced, best, refined] =
                [Method::Gather, BALANCED, BEST, Method::Refined].map(|method| format_cell(results.find(case, method)));
            writeln!(text, "| {scene} | {gather} | {rival} | {balanced} | {best} | {refined} |")?;
        }
        let mean = |of: &dyn Fn(Case) -> Option<Record>| {
            let records: Vec<Record> = cases.iter().filter_map(|&case| of(case)).collect();
            format_cell(Record::mean(&records.iter().collect::<Vec<_>>()).as_ref())
        };
        let of = |method| mean(&|case| results.find(case, method).cloned());
        let rival = mean(&|case| results.best_rival(case).cloned());
        let [gather, balanced, best, refined] = [Method::Gather, BALANCED, BEST, Method::Refined].map(of);
        writeln!(text, "| **mean** | {gather} | {rival} | {balanced} | {best} | {refined} |\n")?;
        writeln!(text, "| method, mean | PSNR / edge / SSIM / FLIP |\n|---|---|")?;
        for method in Method::all() {
            writeln!(text, "| {method} | {} |", of(method))?;
        }
        writeln!(text)?;
    }
    if !results.highlights.is_empty() {
        writeln!(text, "## A lone highlight\n\n| method | ripple % | rim px | lowest % |\n|---|---|---|---|")?;
        for highlight in &results.highlights {
            let (name, of) = (highlight.method.unwrap_or("truth"), highlight.profile);
            writeln!(text, "| {name} | {:.1} | {:.2} | {:.1} |", of.ripple_percent, of.rim_px, of.lowest_percent)?;
        }
        writeln!(text)?;
    }
    if !results.moving.is_empty() {
        writeln!(text, "## What moves\n\n| scene | method | PSNR / edge / SSIM / FLIP |\n|---|---|---|")?;
        for record in &results.moving {
            writeln!(text, "| {} | {} | {} |", record.scene, record.method, format_cell(Some(record)))?;
        }
        writeln!(text)?;
    }
    if !results.flicker.is_empty() {
        writeln!(text, "## Flicker\n\n| method | code values | outlines of a noisy picture |\n|---|---|---|")?;
        for flicker in &results.flicker {
            let Flicker { method, flicker_codes, outline_codes } = flicker;
            writeln!(text, "| {method} | {flicker_codes:.3} | {outline_codes:.3} |")?;
        }
        writeln!(text)?;
    }
    Ok(())
}

/// Writes whether `ours` meets each target.
fn write_verdict(results: &Results, ours: Method, text: &mut String) -> std::fmt::Result {
    writeln!(
        text,
        "## Verdict on `{ours}`\n\nPSNR beyond {ONE_CODE_DB} dB, an error of one code value, counts as that.\n"
    )?;
    let mut say = |target: &str, is_met: bool, found: String| {
        writeln!(text, "- {}: {target}: {found}", if is_met { "met" } else { "**missed**" })
    };
    let clean = results.cases(false);
    let margins = |of: &dyn Fn(Case<'static>) -> Option<f64>| -> Vec<(String, f64)> {
        let name = |case: Case| [Some(case.0), case.1].into_iter().flatten().collect::<Vec<_>>().join(" ");
        let all = results.cases(false).into_iter().chain(results.cases(true));
        all.filter_map(|case| Some((name(case), of(case)?))).collect()
    };
    let seen = |record: &Record| record.psnr_db.min(ONE_CODE_DB);
    let psnr = |case, method| results.find(case, method).map(seen);
    let over = |list: Vec<(String, f64)>| list.iter().map(|item| item.1).sum::<f64>() / list.len().max(1) as f64;
    let is_clean = |case: &Case| clean.contains(case);
    if !clean.is_empty() {
        let gather = over(margins(&|c| is_clean(&c).then_some(psnr(c, ours)? - psnr(c, Method::Gather)?)));
        let target = format!("mean at least {ABOVE_GATHER_DB} dB above the gather");
        say(&target, gather >= ABOVE_GATHER_DB, format!("{gather:+.2} dB"))?;
        let on_each = margins(&|c| is_clean(&c).then_some(psnr(c, ours)? - seen(results.best_rival(c)?)));
        let mean = over(on_each.clone());
        let target = format!("mean at least {ABOVE_BEST_RIVAL_DB} dB above each scene's best rival");
        say(&target, mean >= ABOVE_BEST_RIVAL_DB, format!("{mean:+.2} dB"))?;
        let target = format!("on no scene more than {BELOW_RIVAL_DB} dB below the best rival");
        let (is_met, found) = list_margins(on_each, -BELOW_RIVAL_DB, "dB");
        say(&target, is_met, found)?;
        let ssim = margins(&|c| {
            let rivals = results.records_of(c).filter(|record| record.method.is_rival()).map(|record| record.ssim);
            is_clean(&c).then_some(results.find(c, ours)?.ssim - rivals.reduce(f64::max)?)
        });
        let (is_met, found) = list_margins(ssim, 0.0, "");
        say("SSIM above every rival on every scene", is_met, found)?;
    }
    if let Some(highlight) = results.highlights.iter().find(|highlight| highlight.method == Some(ours.name())) {
        let lowest = highlight.profile.lowest_percent;
        let target = format!("beside a highlight nothing below {LOWEST_PERCENT} %");
        say(&target, lowest >= LOWEST_PERCENT, format!("{lowest:+.1} %"))?;
    }
    let damaged = margins(&|c| (!is_clean(&c)).then_some(psnr(c, ours)? - seen(results.best_rival(c)?)));
    if !damaged.is_empty() {
        let (is_met, found) = list_margins(damaged, 0.0, "dB");
        say("damaged depth: never below the best rival with the same depth", is_met, found)?;
    }
    writeln!(text)
}

/// Returns whether no margin is below `least`, and a list of those below, or the smallest one.
fn list_margins(margins: Vec<(String, f64)>, least: f64, unit: &str) -> (bool, String) {
    let show =
        |(name, margin): &(String, f64)| format!("{name} {margin:+.*} {unit}", if unit.is_empty() { 4 } else { 2 });
    let below: Vec<&(String, f64)> = margins.iter().filter(|item| item.1 < least).collect();
    if below.is_empty() {
        let smallest = margins.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        return (true, format!("closest {}", smallest.map(show).unwrap_or_default().trim_end()));
    }
    let list = below.into_iter().map(show).map(|item| item.trim_end().to_owned()).collect::<Vec<_>>();
    (false, list.join(", "))
}
