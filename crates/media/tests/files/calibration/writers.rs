//! Writes one rig, that of EuRoC, in every format.

// The numbers as the files have them.
#![allow(clippy::excessive_precision)]

use glam::{DMat3, DVec3};

pub const PINHOLES: [[f64; 4]; 2] = [[458.654, 457.296, 367.215, 248.375], [457.587, 456.134, 379.999, 255.238]];
pub const LENSES: [[f64; 4]; 2] =
    [[-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05], [-0.28368365, 0.07451284, -0.00010473, -3.555907e-05]];
const ROTATION: [f64; 9] = [
    0.99999725647788118,
    0.0023120671924238847,
    0.0003760081024155938,
    -0.0023171357232812354,
    0.99989804850664377,
    0.014089835846648196,
    -0.0003433931205241621,
    -0.01409066845271459,
    0.99990066263772825,
];
pub const TRANSLATION_M: [f64; 3] = [-0.11007380812718678, 0.00039912154701414806, -0.00085370250334804494];
/// R1 and R2 of OpenCV's `stereoRectify`, and the focal length, the principal point and the shift of P1 and P2.
const RECTIFIED: [[f64; 9]; 2] = [
    [
        0.99996634753003255,
        -0.001422739138721599,
        0.0080795804834891509,
        0.0013657418346424666,
        0.9999741760894848,
        0.0070556291992505274,
        -0.0080894101569358272,
        -0.0070443571388281358,
        0.99994246758291727,
    ],
    [
        0.99996335261943714,
        -0.0036258118715555435,
        0.0077554436602301352,
        0.0036803985472553301,
        0.99996847527716304,
        -0.0070358452512171675,
        -0.0077296885207799784,
        0.0070641305294990983,
        0.99994517348464362,
    ],
];
const FOCAL_PX: f64 = 436.24429564709413;
const CENTER_PX: [f64; 2] = [364.44123458862305, 256.95167541503906];
const SHIFT: f64 = -48.020830733296798;

fn list(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
}

fn camera_matrix(side: usize) -> [f64; 9] {
    let [fx, fy, cx, cy] = PINHOLES[side];
    [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
}

fn projection(side: usize) -> [f64; 12] {
    let ([cx, cy], shift) = (CENTER_PX, [0.0, SHIFT][side]);
    [FOCAL_PX, 0.0, cx, shift, 0.0, FOCAL_PX, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
}

/// Writes a pose as 4x4 numbers.
fn pose(rotation: DMat3, translation: DVec3) -> [f64; 16] {
    let r = rotation.transpose().to_cols_array();
    let t = translation;
    [r[0], r[1], r[2], t.x, r[3], r[4], r[5], t.y, r[6], r[7], r[8], t.z, 0.0, 0.0, 0.0, 1.0]
}

pub fn rotation() -> DMat3 {
    DMat3::from_cols_array(&ROTATION).transpose()
}

/// Returns the matrices of OpenCV's file: name, rows, columns, numbers; the translation is in this unit.
fn matrices(unit_m: f64) -> Vec<(&'static str, usize, usize, Vec<f64>)> {
    vec![
        ("M1", 3, 3, camera_matrix(0).to_vec()),
        ("D1", 1, 4, LENSES[0].to_vec()),
        ("M2", 3, 3, camera_matrix(1).to_vec()),
        ("D2", 1, 4, LENSES[1].to_vec()),
        ("R", 3, 3, ROTATION.to_vec()),
        ("T", 3, 1, TRANSLATION_M.map(|metres| metres / unit_m).to_vec()),
    ]
}

pub fn opencv_yaml(head: &str, colon: &str, unit_m: f64) -> String {
    let write = |(name, rows, cols, data): (&str, usize, usize, Vec<f64>)| {
        format!(
            "{name}: !!opencv-matrix\n   rows{colon}{rows}\n   cols{colon}{cols}\n   dt: d\n   data{colon}[{}]\n",
            list(&data)
        )
    };
    format!("{head}\n---\n{}", matrices(unit_m).into_iter().map(write).collect::<String>())
}

pub fn flat() -> String {
    let write = |(name, _, _, data): (&str, usize, usize, Vec<f64>)| format!("{name}: [{}]\n", list(&data));
    format!("image_width: 752\nimage_height: 480\n{}", matrices(1.0).into_iter().map(write).collect::<String>())
}

fn kalibr(poses: [String; 2]) -> String {
    let camera = |side: usize| {
        format!(
            "cam{side}:\n{}  camera_model: pinhole\n  distortion_coeffs: [{}]\n  distortion_model: radtan\n  \
             intrinsics: [{}]\n  resolution: [752, 480]\n",
            poses[side],
            list(&LENSES[side]),
            list(&PINHOLES[side])
        )
    };
    camera(0) + &camera(1)
}

pub fn kalibr_imu() -> String {
    let left = (DMat3::from_rotation_z(1.5) * DMat3::from_rotation_x(0.2), DVec3::new(0.065, -0.02, -0.008));
    let right = (rotation() * left.0, rotation() * left.1 + DVec3::from_array(TRANSLATION_M));
    kalibr([left, right].map(|(rotation, place)| format!("  T_cam_imu: [{}]\n", list(&pose(rotation, place)))))
}

fn kalibr_flat() -> String {
    let flat = list(&pose(rotation(), DVec3::from_array(TRANSLATION_M)));
    kalibr([String::new(), format!("  T_cn_cnm1: [{flat}]\n")])
}

fn euroc_flat() -> [String; 2] {
    let body = rotation().transpose();
    let poses = [pose(DMat3::IDENTITY, DVec3::ZERO), pose(body, -(body * DVec3::from_array(TRANSLATION_M)))];
    [0, 1].map(|side| {
        format!(
            "T_BS: [{}]\ncamera_model: pinhole\nintrinsics: [{}]\nresolution: [752, 480]\ndistortion_model: \
             radial-tangential\ndistortion_coefficients: [{}]\n",
            list(&poses[side]),
            list(&PINHOLES[side]),
            list(&LENSES[side])
        )
    })
}

pub fn ros() -> [String; 2] {
    let matrix = |name: &str, rows: usize, cols: usize, data: &[f64]| {
        format!("{name}:\n  rows: {rows}\n  cols: {cols}\n  data: [{}]\n", list(data))
    };
    [0, 1].map(|side| {
        [
            format!("image_width: 752\nimage_height: 480\ncamera_name: narrow_stereo/{side}\n"),
            matrix("camera_matrix", 3, 3, &camera_matrix(side)),
            "distortion_model: plumb_bob\n".into(),
            matrix("distortion_coefficients", 1, 5, &[&LENSES[side][..], &[0.0]].concat()),
            matrix("rectification_matrix", 3, 3, &RECTIFIED[side]),
            matrix("projection_matrix", 3, 4, &projection(side)),
        ]
        .concat()
    })
}

/// The message of ROS, as `rostopic echo` prints it.
fn ros_message(side: usize) -> String {
    format!(
        "header: \n  seq: 7\n  frame_id: \"left\"\nheight: 480\nwidth: 752\ndistortion_model: \"rational_polynomial\"\n\
         D: [{}, 0.0, 0.0, 0.0, 0.0]\nK: [{}]\nR: [{}]\nP: [{}]\nbinning_x: 0\n---\n",
        list(&LENSES[side]),
        list(&camera_matrix(side)),
        list(&RECTIFIED[side]),
        list(&projection(side))
    )
}

/// Writes OAK's JSON of three cameras; the colour camera, socket 0, is `via` or beside the path from left to right.
pub fn oak(via: bool) -> String {
    let (turn, place) = (rotation(), DVec3::from_array(TRANSLATION_M));
    let middle = (DMat3::from_rotation_y(0.01), DVec3::new(-0.04, 0.001, 0.002));
    let rest = (turn * middle.0.transpose(), place - turn * (middle.0.transpose() * middle.1));
    let camera = |socket: usize, side: usize, (to, pose): (i32, (DMat3, DVec3))| {
        let rows = |m: &[f64]| m.chunks(3).map(|row| format!("[{}]", list(row))).collect::<Vec<_>>().join(", ");
        let (t, turn) = (pose.1 * 100.0, pose.0.transpose().to_cols_array());
        let turn = if to < 0 { String::new() } else { rows(&turn) };
        format!(
            "[{socket}, {{\"cameraType\": 0, \"distortionCoeff\": [{}, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], \"extrinsics\": \
             {{\"rotationMatrix\": [{turn}], \"toCameraSocket\": {to}, \"translation\": {{\"x\": {}, \"y\": {}, \
             \"z\": {}}}}}, \"height\": 480, \"width\": 752, \"intrinsicMatrix\": [{}]}}]",
            list(&LENSES[side]),
            t.x,
            t.y,
            t.z,
            rows(&camera_matrix(side))
        )
    };
    let end = (-1, (DMat3::IDENTITY, DVec3::ZERO));
    let (left, color) = match via {
        true => ((0, middle), (2, rest)),
        false => ((2, (turn, place)), end),
    };
    format!(
        "{{\"boardName\": \"OAK-D\", \"cameraData\": [{}, {}, {}]}}",
        camera(2, 1, end),
        camera(0, 0, color),
        camera(1, 0, left)
    )
}

pub fn zed() -> String {
    let camera = |side: usize, name: &str, zoom: f64| {
        let [fx, fy, cx, cy] = PINHOLES[side].map(|px| px * zoom);
        let [k1, k2, p1, p2] = LENSES[side];
        format!("[{name}]\nfx={fx}\nfy={fy}\ncx={cx}\ncy={cy}\nk1={k1}\nk2={k2}\np1={p1}\np2={p2}\n\n")
    };
    let turn = glam::DQuat::from_mat3(&rotation()).to_scaled_axis();
    let [x, y, z] = TRANSLATION_M.map(|metres| metres * 1e3);
    [
        camera(0, "LEFT_CAM_HD", 1.0),
        camera(1, "RIGHT_CAM_HD", 1.0),
        camera(0, "LEFT_CAM_2K", 1.725),
        camera(1, "RIGHT_CAM_2K", 1.725),
        format!(
            "; millimetres\n[STEREO]\nBaseline={}\nTY={y}\nTZ={z}\nRX_HD={}\nCV_HD={}\nRZ_HD={}\n",
            -x, turn.x, turn.y, turn.z
        ),
    ]
    .concat()
}

/// Returns every file, or pair of files, with the rig.
pub fn all() -> Vec<(&'static str, Vec<String>)> {
    let one = |text: String| vec![text];
    let [left, right] = ros();
    vec![
        ("YAML 1.2", one(opencv_yaml("%YAML 1.2", ": ", 1.0))),
        ("YAML:1.0 in mm", one(opencv_yaml("%YAML:1.0", ": ", 1e-3))),
        ("YAML without spaces", one(opencv_yaml("%YAML:1.0", ":", 1.0))),
        ("flat", one(flat())),
        ("flat, Windows", one(format!("\u{feff}{}", flat().replace('\n', "\r\n")))),
        ("Kalibr, flat", one(kalibr_flat())),
        ("Kalibr with IMU", one(kalibr_imu())),
        ("EuRoC, flat", euroc_flat().to_vec()),
        ("ROS", vec![left.clone(), right.clone()]),
        ("ROS, right first", vec![right, left]),
        ("ROS messages", vec![ros_message(0), ros_message(1)]),
        (
            "ROS 2 messages",
            [0, 1].map(|side| ros_message(side).replace("\nD:", "\nd:").replace("\nK:", "\nk:")).to_vec(),
        ),
        ("OAK", one(oak(false))),
        ("OAK over the colour camera", one(oak(true))),
        (
            "OAK, sockets stated",
            one(oak(true).replacen(
                '{',
                "{\"stereoRectificationData\": {\"leftCameraSocket\": 1, \"rightCameraSocket\": 2}, ",
                1,
            )),
        ),
        ("ZED", one(zed())),
        ("ZED in lower case", one(zed().to_lowercase())),
        ("ZED, one lens", one(one_lens(&zed()))),
    ]
}

/// Moves the lenses of a ZED's file to sections for all sizes.
fn one_lens(conf: &str) -> String {
    let is_lens = |line: &&str| ["k1=", "k2=", "p1=", "p2="].iter().any(|key| line.starts_with(key));
    let mut text: String = conf.lines().filter(|line| !is_lens(line)).map(|line| format!("{line}\r\n")).collect();
    for (name, [k1, k2, p1, p2]) in [("LEFT_DISTO", LENSES[0]), ("RIGHT_DISTO", LENSES[1])] {
        text += &format!("[{name}]\r\nk1 = {k1}\r\nk2 = {k2}\r\np1 = {p1}\r\np2 = {p2}\r\n");
    }
    text
}
