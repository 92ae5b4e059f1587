//! Depth of a scene with exact depth, as the device's cameras see it, comes back in the view of the colour camera.

use bokehcam_media::recording::{Options, Recording};

use super::matroska::{Take, block, track};
use super::{Scene, depth_of};

/// Parameters of the cameras in the order of the file, and the pose of the colour camera: like a real device's.
const DEPTH: [f64; 14] =
    [0.5123, 0.4945, 0.4921, 0.4922, 3.1306, 2.3249, 0.1304, 3.4587, 3.3501, 0.6629, 0.0, 0.0, -5.1e-5, 8.1e-5];
const COLOR: [f64; 14] =
    [0.49676, 0.51086, 0.47091, 0.62745, 0.7227, -2.8856, 1.6327, 0.6022, -2.7196, 1.5651, 0.0, 0.0, -1.4e-4, 7.8e-4];
const ROTATION: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 0.994_521_9, 0.104_528_5], [0.0, -0.104_528_5, 0.994_521_9]];
const TRANSLATION_M: [f64; 3] = [-0.032, -0.0019, 0.0042];

/// Returns the device's calibration.
pub fn json() -> String {
    let camera =
        |location: &str, (width, height): (u32, u32), parameters: &[f64; 14], rotation: &[f64], at: &[f64; 3]| {
            format!(
                r#"{{"Intrinsics":{{"ModelParameterCount":14,"ModelParameters":{parameters:?},
            "ModelType":"CALIBRATION_LensDistortionModelBrownConrady"}},
            "Location":"CALIBRATION_CameraLocation{location}","MetricRadius":1.74,
            "Rt":{{"Rotation":{rotation:?},"Translation":{at:?}}},"SensorHeight":{height},"SensorWidth":{width}}}"#
            )
        };
    let unit = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let depth = camera("D0", (1024, 1024), &DEPTH, &unit, &[0.0; 3]);
    let color = camera("PV0", (4096, 3072), &COLOR, ROTATION.as_flattened(), &TRANSLATION_M);
    format!(r#"{{"CalibrationInformation":{{"Cameras":[{depth},{color}],"InertialSensors":[]}}}}"#)
}

/// A camera: its parameters, the size of the sensor after binning, where its pictures begin there, and their size.
struct Camera<'a> {
    parameters: &'a [f64; 14],
    sensor: [f64; 2],
    offset: [f64; 2],
    size: (u32, u32),
}

impl Camera<'_> {
    /// Returns where the ray through (`x`, `y`, 1) is on the picture; coordinates begin at the corner of the first pixel.
    fn project(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [cx, cy, fx, fy, ..] = *self.parameters;
        let [x, y] = self.distort([x, y]);
        [(x * fx + cx) * self.sensor[0] - self.offset[0], (y * fy + cy) * self.sensor[1] - self.offset[1]]
    }

    fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [_, _, _, _, k1, k2, k3, k4, k5, k6, _, _, p2, p1] = *self.parameters;
        let r2 = x * x + y * y;
        let radial =
            (1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3)) / (1.0 + k4 * r2 + k5 * r2.powi(2) + k6 * r2.powi(3));
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y),
        ]
    }

    /// Inverts [`Self::project`].
    fn unproject(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [cx, cy, fx, fy, ..] = *self.parameters;
        let goal =
            [((u + self.offset[0]) / self.sensor[0] - cx) / fx, ((v + self.offset[1]) / self.sensor[1] - cy) / fy];
        let mut guess = goal;
        for _ in 0..200 {
            let found = self.distort(guess);
            let off = [goal[0] - found[0], goal[1] - found[1]];
            guess = [guess[0] + off[0], guess[1] + off[1]];
            if off[0].abs() + off[1].abs() < 1e-9 {
                break;
            }
        }
        guess
    }
}

/// What a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Surface {
    Box,
    Wall,
}

/// Returns where a ray meets a wall 2 m in front of the depth camera, or the face of a box 1 m in front of it.
fn meet(origin: [f64; 3], direction: [f64; 3]) -> (Surface, [f64; 3]) {
    let at = |z: f64| {
        let length = (z - origin[2]) / direction[2];
        [0, 1, 2].map(|axis| origin[axis] + length * direction[axis])
    };
    let face = at(1.0);
    match (-0.31..0.24).contains(&face[0]) && (-0.2..0.23).contains(&face[1]) {
        true => (Surface::Box, face),
        false => (Surface::Wall, at(2.0)),
    }
}

/// Returns `rotation * point`, or with its transpose.
fn rotate(point: [f64; 3], is_back: bool) -> [f64; 3] {
    let part = |row: usize, column: usize| if is_back { ROTATION[column][row] } else { ROTATION[row][column] };
    [0, 1, 2].map(|row| (0..3).map(|column| part(row, column) * point[column]).sum())
}

/// Renders the scene for the depth camera, reads it as a recording, and compares the depth with that of the colour
/// camera.
fn check(depth: Camera, color_size: (u32, u32), sensor: [f64; 2], offset: [f64; 2]) {
    let ((width, height), scene) = (depth.size, Scene::new());
    let mut map = Vec::new();
    for at in 0..width * height {
        let [x, y] = depth.unproject([f64::from(at % width) + 0.5, f64::from(at / width) + 0.5]);
        let (_, [.., z]) = meet([0.0; 3], [x, y, 1.0]);
        map.extend(((z * 1000.0).round() as u16).to_be_bytes());
    }
    let (columns, rows) = color_size;
    let mut take = Take::with_frames("YUY2", 0);
    take.tracks = vec![track(1, "COLOR", "YUY2", color_size), track(2, "DEPTH", "b16g", depth.size)];
    take.calibration = Some(json());
    let picture = vec![128; (2 * columns * rows) as usize];
    take.clusters = vec![(0, vec![block(1, 0, &picture), block(2, 900, &map)])];
    scene.write("take.mkv", take.file());
    let recording = Recording::open(&scene.path("take.mkv"), &Options::default()).unwrap();
    let found = depth_of(&recording, 0).unwrap();

    // The pixels of the map, which has fewer than the picture.
    let scale = [f64::from(columns) / f64::from(found.width), f64::from(rows) / f64::from(found.height)];
    let color = Camera { parameters: &COLOR, sensor, offset, size: color_size };
    let camera_m = rotate(TRANSLATION_M.map(|metres| -metres), true);
    // What the colour camera sees, its distance there, and whether the depth camera sees it.
    let see = |x: f64, y: f64| {
        let [across, down] = color.unproject([(x + 0.5) * scale[0], (y + 0.5) * scale[1]]);
        let (surface, point) = meet(camera_m, rotate([across, down, 1.0], true));
        let ray = [point[0] / point[2], point[1] / point[2]];
        let [u, v] = depth.project(ray);
        let is_inside = (2.0..f64::from(width) - 2.0).contains(&u) && (2.0..f64::from(height) - 2.0).contains(&v);
        let is_seen = is_inside && meet([0.0; 3], [ray[0], ray[1], 1.0]).0 == surface;
        (surface, rotate(point, false)[2] + TRANSLATION_M[2], is_seen)
    };
    let (mut compared, mut boxes) = (0, 0);
    for (y, x) in (0..found.height).step_by(3).flat_map(|y| (0..found.width).step_by(2).map(move |x| (y, x))) {
        let (surface, expected_m, is_seen) = see(x.into(), y.into());
        let around =
            [(-1.5, 0.0), (1.5, 0.0), (0.0, -1.5), (0.0, 1.5), (-1.1, -1.1), (1.1, 1.1), (-1.1, 1.1), (1.1, -1.1)];
        let is_edge = around.iter().any(|(right, down)| {
            let (other, _, is_other_seen) = see(f64::from(x) + right, f64::from(y) + down);
            other != surface || is_other_seen != is_seen
        });
        if is_edge {
            continue;
        }
        let metres = f64::from(found.metres[(y * found.width + x) as usize]);
        if is_seen {
            assert!((metres / expected_m - 1.0).abs() < 0.01, "{metres} m at {x}, {y}: {surface:?} at {expected_m} m");
            compared += 1;
            boxes += u32::from(surface == Surface::Box);
        }
    }
    assert!(compared > 2000 && boxes > 400, "{compared} pixels were compared, {boxes} of the box");
}

#[test]
fn depth_of_the_narrow_mode_is_where_a_wide_picture_has_it() {
    let depth = Camera { parameters: &DEPTH, sensor: [512.0; 2], offset: [96.0, 90.0], size: (320, 288) };
    check(depth, (1280, 720), [1280.0, 960.0], [0.0, 120.0]);
}

#[test]
fn depth_of_the_wide_mode_is_where_a_picture_of_the_whole_sensor_has_it() {
    let depth = Camera { parameters: &DEPTH, sensor: [512.0; 2], offset: [0.0; 2], size: (512, 512) };
    check(depth, (2048, 1536), [2048.0, 1536.0], [0.0; 2]);
}

#[test]
fn depth_of_all_pixels_is_where_a_picture_has_it() {
    let depth = Camera { parameters: &DEPTH, sensor: [1024.0; 2], offset: [192.0, 180.0], size: (640, 576) };
    check(depth, (1920, 1080), [1920.0, 1440.0], [0.0, 180.0]);
}
