//! Errors of apertures approximated by a few separable kernels (McGraw 2015, eq. 1 and 2).
use bokehcam::bokeh::aperture::{Aperture, Shape};
use bokehcam::bokeh::low_rank::Decomposition;

fn main() {
    for (name, shape) in [
        ("disc", Shape::Disc),
        ("hexagon", Shape::Polygon { blades: 6, rotation_deg: 0.0, curvature: 0.0 }),
        ("heart", Shape::Heart),
    ] {
        let mask = Aperture { shape, intensity: 0.0 }.to_mask(65, 0.2);
        let kernels = Decomposition::new(&mask);
        let errors: Vec<String> = (1..=4).map(|rank| format!("{:.3}", kernels.relative_error(rank))).collect();
        println!("{name}: relative error of rank 1 to 4: {}", errors.join(", "));
    }
}
