//! Relative depth in a second video file, paired with the colour frames by their number.

use std::time::Duration;

use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::DepthMap;
use bokehcam_media::recording::depth_covers;
use bokehcam_media::recording::depth_file::has_colors;
use bokehcam_video::{Conversion, Decoded, Decoder, Pixels, VideoError, VideoFile};

/// How long one call of the decoder waits.
const PATIENCE: Duration = Duration::from_millis(100);

/// Reads the depth of each frame from the frame of the same number of a video: luma is relative inverse depth.
pub struct VideoDepth {
    file: VideoFile,
    conversion: Conversion,
    white_is_far: bool,
    decoder: Decoder,
    /// Number of pictures that the decoder has returned.
    decoded: usize,
    /// The last of them, or the part of the next one that has arrived.
    picture: Vec<u8>,
}

impl VideoDepth {
    /// Opens the depth of pictures of `color_px`, at most at that size. Black is the farthest and white the nearest, or
    /// the other way round.
    ///
    /// # Errors
    /// The video has another aspect ratio or is in colours, or ffmpeg is missing.
    pub fn open(file: VideoFile, color_px: (u32, u32), white_is_far: bool) -> Result<Self, VideoError> {
        let size_px = fit(file.size_px, color_px);
        if !depth_covers(size_px, color_px) {
            return Err(VideoError::DepthSize { path: file.path, found: file.size_px, color: color_px });
        }
        refuse_colors(&file, size_px)?;
        let conversion = Conversion { size_px, pixels: Pixels::Grey16, fps: None, start_s: 0.0 };
        let decoder = Decoder::start(&file, &conversion)?;
        let picture = vec![0; size_px.0 as usize * size_px.1 as usize * Pixels::Grey16.bytes()];
        Ok(Self { file, conversion, white_is_far, decoder, decoded: 0, picture })
    }

    /// Decodes up to the picture `index`, from the first one if that has passed.
    fn decode(&mut self, index: usize) -> Result<(), VideoError> {
        if index + 1 < self.decoded {
            self.decoder = Decoder::start(&self.file, &self.conversion)?;
            self.decoded = 0;
        }
        while self.decoded <= index {
            match self.decoder.read(&mut self.picture, PATIENCE)? {
                Decoded::Picture(_) => self.decoded += 1,
                Decoded::Waiting => {}
                Decoded::End => {
                    let (path, frames) = (self.file.path.clone(), self.decoded as u64);
                    return Err(VideoError::FrameCount { path, frames, needed: index as u64 + 1 });
                }
            }
        }
        Ok(())
    }
}

impl DepthSource for VideoDepth {
    fn read(&mut self, FrameInput { stamp, .. }: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        self.decode(stamp.index)?;
        map.resize(self.conversion.size_px.0, self.conversion.size_px.1);
        for (metres, &bytes) in map.metres.iter_mut().zip(self.picture.as_chunks::<2>().0) {
            let white = f32::from(u16::from_le_bytes(bytes)) / f32::from(u16::MAX);
            *metres = DepthMap::relative_to_metres(if self.white_is_far { 1.0 - white } else { white });
        }
        Ok(())
    }
}

/// Refuses a video whose first picture has colours.
fn refuse_colors(file: &VideoFile, size_px: (u32, u32)) -> Result<(), VideoError> {
    let conversion = Conversion { size_px, pixels: Pixels::Rgb24, fps: None, start_s: 0.0 };
    let mut decoder = Decoder::start(file, &conversion)?;
    let mut picture = vec![0; size_px.0 as usize * size_px.1 as usize * Pixels::Rgb24.bytes()];
    loop {
        match decoder.read(&mut picture, PATIENCE)? {
            Decoded::Waiting => {}
            Decoded::Picture(_) if has_colors(&picture) => {
                return Err(VideoError::ColoredDepth { path: file.path.clone() });
            }
            Decoded::Picture(_) | Decoded::End => return Ok(()),
        }
    }
}

/// Returns the size of a depth map that is scaled down to fit into the colour picture, if it is larger.
fn fit((width, height): (u32, u32), color_px: (u32, u32)) -> (u32, u32) {
    let scale = (f64::from(color_px.0) / f64::from(width)).min(f64::from(color_px.1) / f64::from(height)).min(1.0);
    [width, height].map(|side| ((f64::from(side) * scale).round() as u32).max(1)).into()
}
