//! Networks recognised by the hash of their content, with task, input scaling and source.

use sha2::{Digest, Sha256};

use bokehcam::names::named;

named! {
    /// What a network finds in a picture.
    pub enum Task default Matte {
        /// Where a person is
        Matte = "matte",
        /// How near everything is
        Mono = "mono",
    }
}

/// The conversion of the codes 0 to 255 of a picture to the network's input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaling {
    /// Subtracted from a code, per channel in the network's order.
    pub mean: [f32; 3],
    /// Divisor of the difference.
    pub divisor: [f32; 3],
}

impl Scaling {
    /// Scales to 0..1.
    pub const UNIT: Self = Self { mean: [0.0; 3], divisor: [255.0; 3] };
    /// Scales to -1..1.
    pub const SIGNED: Self = Self { mean: [127.5; 3], divisor: [127.5; 3] };
    /// Leaves the codes as they are.
    pub const CODES: Self = Self { mean: [0.0; 3], divisor: [1.0; 3] };
    /// Mean and standard deviation of ImageNet.
    pub const IMAGENET: Self = Self { mean: [123.675, 116.28, 103.53], divisor: [58.395, 57.12, 57.375] };
}

/// A recognised network.
#[derive(Debug)]
pub struct KnownNetwork {
    /// Its file name when installed, which also serves as its name.
    pub file: &'static str,
    /// Its task.
    pub task: Task,
    /// SHA-256 of its file, in hexadecimal.
    pub sha256: &'static str,
    /// Size of its file.
    pub bytes: u64,
    /// Licence of the network.
    pub license: &'static str,
    /// Download address of its file.
    pub address: &'static str,
    /// Scaling of its input.
    pub scaling: Scaling,
    /// Whether blue comes first.
    pub bgr: bool,
}

/// The best network of each task first; among equals, the fastest.
pub static KNOWN_NETWORKS: [KnownNetwork; 7] = [
    KnownNetwork {
        file: "selfie-landscape.tflite",
        task: Task::Matte,
        sha256: "4aafe6223bb8dac6fac8ca8ed56852870a33051ef3f6238822d282a109962894",
        bytes: 249_792,
        license: "Apache-2.0 (MediaPipe Selfie Segmentation)",
        address: "https://cdn.jsdelivr.net/npm/@mediapipe/selfie_segmentation@0.1.1675465747/selfie_segmentation_landscape.tflite",
        scaling: Scaling::UNIT,
        bgr: false,
    },
    KnownNetwork {
        file: "selfie-landscape.onnx",
        task: Task::Matte,
        sha256: "b580fea1ee4a608472e07e4c2a21af1771d9022bb444e34b7f83719483cb5026",
        bytes: 453_831,
        license: "Apache-2.0 (MediaPipe Selfie Segmentation)",
        address: "https://github.com/google-ai-edge/mediapipe/raw/98efaed723c5/mediapipe/modules/selfie_segmentation/selfie_segmentation_landscape.onnx",
        scaling: Scaling::UNIT,
        bgr: false,
    },
    KnownNetwork {
        file: "selfie.onnx",
        task: Task::Matte,
        sha256: "1511ab5564cb0ae179cba9bcad6ad931003ccc71656f11fd270967023678c6a5",
        bytes: 447_596,
        license: "Apache-2.0 (MediaPipe Selfie Segmentation)",
        address: "https://github.com/royshil/obs-backgroundremoval/raw/875ffda175fc/data/models/selfie_segmentation.onnx",
        scaling: Scaling::UNIT,
        bgr: false,
    },
    KnownNetwork {
        file: "selfie-planes.onnx",
        task: Task::Matte,
        sha256: "3241ac4ad8aa35bdaf33946776db29f7c283a413aa0b0dacb9483594b4531aad",
        bytes: 462_352,
        license: "Apache-2.0 (MediaPipe Selfie Segmentation)",
        address: "https://github.com/kaito-tokyo/live-backgroundremoval-lite/raw/3b0b5707dcf2/data/models/model.onnx",
        scaling: Scaling::UNIT,
        bgr: false,
    },
    KnownNetwork {
        file: "selfie-int8.onnx",
        task: Task::Matte,
        sha256: "9bc3d56b0b1397acbdafb631ab5c7bf14a889c00fbe2018e36503c65a2b65983",
        bytes: 223_977,
        license: "Apache-2.0 (MediaPipe Selfie Segmentation)",
        address: "https://github.com/kaito-tokyo/live-backgroundremoval-lite/raw/3b0b5707dcf2/data/models/model_int8.onnx",
        scaling: Scaling::UNIT,
        bgr: false,
    },
    KnownNetwork {
        file: "sinet.onnx",
        task: Task::Matte,
        sha256: "17a75acc69747e443717dfaef152ee3c4615f2d81b0269f7c0224c47584af46a",
        bytes: 395_434,
        license: "MIT (SINet, clovaai)",
        address: "https://github.com/royshil/obs-backgroundremoval/raw/875ffda175fc/data/models/SINet_Softmax_simple.onnx",
        // Trained with blue first, and with its own mean and deviation, divided by 255 once more.
        scaling: Scaling {
            mean: [102.890_434, 111.252_47, 126.912_12],
            divisor: [62.932_92 * 255.0, 62.821_38 * 255.0, 66.355_705 * 255.0],
        },
        bgr: true,
    },
    KnownNetwork {
        file: "tcmonodepth-small.onnx",
        task: Task::Mono,
        sha256: "902b886beaebd3f68deb40bab2fd636a0c112c1ef1cbdd15fa26e5c55b389b4d",
        bytes: 790_459,
        license: "MIT (TCMonoDepth, Yu Li)",
        address: "https://github.com/royshil/obs-backgroundremoval/raw/875ffda175fc/data/models/tcmonodepth_tcsmallnet_192x320.onnx",
        scaling: Scaling::CODES,
        bgr: false,
    },
];

impl KnownNetwork {
    /// Returns the known network with this content.
    pub fn identify(bytes: &[u8]) -> Option<&'static Self> {
        if !Self::is_known_size(bytes.len() as u64) {
            return None;
        }
        let digest = to_hex(&Sha256::digest(bytes));
        KNOWN_NETWORKS.iter().find(|known| known.sha256 == digest)
    }

    /// Returns whether a known network has this size: files of other sizes need not be read.
    pub fn is_known_size(bytes: u64) -> bool {
        KNOWN_NETWORKS.iter().any(|known| known.bytes == bytes)
    }

    /// Returns the first known network of this name, with or without file extension.
    pub fn find_by_name(name: &str) -> Option<&'static Self> {
        KNOWN_NETWORKS
            .iter()
            .find(|known| known.file == name || known.file.split_once('.').is_some_and(|(stem, _)| stem == name))
    }
}

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
