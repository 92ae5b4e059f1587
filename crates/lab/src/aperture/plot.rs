//! Plots error over rank of several apertures as SVG.

use plotters::prelude::*;

use super::analysis::Analysis;

const SIZE_PX: (u32, u32) = (880, 560);
/// Lower end of the error axis in percent; smaller errors are not drawn.
const MIN_PERCENT: f64 = 0.01;
/// Colours that colour-blind people can distinguish (Okabe and Ito 2008).
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 0, 0),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
];

/// Plots truncation error in percent on a logarithmic axis over the number of separable terms.
///
/// # Errors
/// The drawing library fails.
pub fn plot_error_by_rank(analyses: &[Analysis], size_px: u16, rim: f32) -> Result<String, String> {
    let mut svg = String::new();
    let area = SVGBackend::with_string(&mut svg, SIZE_PX).into_drawing_area();
    draw(&area, analyses, size_px, rim).map_err(|error| error.to_string())?;
    drop(area);
    Ok(svg)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

/// Draws the whole diagram: one curve and one legend entry per aperture.
fn draw(
    area: &Area,
    analyses: &[Analysis],
    size_px: u16,
    rim: f32,
) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    area.fill(&WHITE)?;
    let ranks = analyses.iter().map(|analysis| analysis.truncation_errors.len()).max().unwrap_or(1);
    let visible_percent = |error: &f64| Some(error * 100.0).filter(|&percent| percent >= MIN_PERCENT);
    let errors = analyses.iter().flat_map(|analysis| analysis.truncation_errors.iter().filter_map(visible_percent));
    // Round down to a power of ten, and cover at least the decade from 10 to 100 %.
    let (low, high) = (10f64.powf(errors.fold(10.0, f64::min).log10().floor()), 100.0);
    let mut chart = ChartBuilder::on(area)
        .caption(
            format!("Error by rank: kernels of {size_px} x {size_px}, rim {rim}"),
            ("sans-serif", 20).into_font().color(&BLACK),
        )
        .margin(14)
        .x_label_area_size(46)
        .y_label_area_size(64)
        .build_cartesian_2d(0.5..ranks as f64 + 0.5, (low..high).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("rank (separable terms)")
        .y_desc("relative Frobenius error (%)")
        .x_labels(ranks.min(32))
        .x_label_formatter(&|rank| if rank.fract() == 0.0 { format!("{rank}") } else { String::new() })
        .y_label_formatter(&|percent| format!("{percent}"))
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 16))
        .bold_line_style(BLACK.mix(0.18))
        .light_line_style(BLACK.mix(0.06))
        .draw()?;
    for (analysis, color) in analyses.iter().zip(COLORS.iter().cycle()) {
        // At its exact rank a kernel has no error to draw.
        let points: Vec<(f64, f64)> =
            (1..).map(f64::from).zip(analysis.truncation_errors.iter().map_while(visible_percent)).collect();
        let line = color.stroke_width(2);
        chart
            .draw_series(LineSeries::new(points, line).point_size(3))?
            .label(analysis.name.clone())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], line));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.9))
        .border_style(BLACK.mix(0.3))
        .label_font(("sans-serif", 14))
        .draw()?;
    area.present()
}
