//! Turns, flips and cuts the pictures of a source, and all that is in their pixels.

use std::sync::Arc;

use super::options::Orientation;
use super::{Source, SourceError};
use crate::capture::CaptureError;
use crate::capture::transformed::TransformedCamera;
use bokehcam::depth::DepthSource;
use bokehcam::depth::focus::FocusRule;
use bokehcam::depth::transformed::TransformedDepth;
use bokehcam::frame::DepthMap;
use bokehcam::frame::transform::Transform;
use bokehcam_media::recording::Photo;

/// The transform of a source's pictures, and their size before it.
#[derive(Clone, Copy)]
pub(super) struct SourceTransform {
    transform: Transform,
    /// Width and height of the source's own pictures.
    pub own_px: (u32, u32),
}

impl SourceTransform {
    /// Returns the transform that the options ask for; `source` is not transformed yet.
    pub fn new(options: Orientation, source: &Source) -> Self {
        Self { transform: options.transform(), own_px: source.camera.info().size }
    }

    /// Transforms the pictures of a source, and its own depth. Stereo pairs are rectified and matched before that.
    ///
    /// # Errors
    /// The area to keep is not within the pictures.
    pub fn apply_to_source(&self, source: Source) -> Result<Source, SourceError> {
        if self.transform.is_identity() {
            return Ok(source);
        }
        let is_matched = source.rig.is_some();
        let camera = TransformedCamera::new(source.camera, self.transform, is_matched).map_err(to_usage)?;
        let depth = source.depth.map(|depth| {
            let depth = TransformedDepth::new(depth, self.transform, self.own_px);
            Box::new(if is_matched { depth.with_pictures() } else { depth }) as Box<dyn DepthSource>
        });
        let first_depth = source.first_depth.map(|map| self.apply_to_map(map));
        let mut findings = source.findings;
        let transform = |original| Arc::new(self.transform.transform_color(Arc::unwrap_or_clone(original)));
        findings.original = findings.original.map(transform);
        if let Some(FocusRule::Point { x, y }) = findings.focus {
            let point = self.transform.apply_to_point([x, y], self.own_px);
            findings.focus = point.map(|[x, y]| FocusRule::Point { x, y });
            if point.is_none() {
                findings.notes.push("the focus of the photo is outside of --crop, and is not used".to_owned());
            }
        }
        Ok(Source { camera: Box::new(camera), depth, first_depth, findings, ..source })
    }

    /// Transforms the maps of a depth source for the source's own pictures.
    pub fn apply_to_depth(&self, depth: Box<dyn DepthSource>) -> Box<dyn DepthSource> {
        match self.transform.is_identity() {
            true => depth,
            false => Box::new(TransformedDepth::new(depth, self.transform, self.own_px)),
        }
    }

    /// Transforms a depth map of the source's own pictures.
    pub fn apply_to_map(&self, map: DepthMap) -> DepthMap {
        self.transform.transform_map(map, self.own_px)
    }
}

/// Turns, flips and cuts a photo that was read from the file called `name`.
///
/// # Errors
/// The area to keep is not within the picture.
pub fn transform_photo(options: Orientation, name: &str, photo: &mut Photo) -> Result<(), SourceError> {
    let transform = options.transform();
    if transform.is_identity() {
        return Ok(());
    }
    let outside = |size_px| CaptureError::AreaOutside { source_name: name.to_owned(), area: transform.area, size_px };
    transform.output_size(photo.color.size()).map_err(outside).map_err(to_usage)?;
    photo.transform(&transform);
    Ok(())
}

/// Another area would fit: the options are wrong, not the source.
fn to_usage(error: CaptureError) -> SourceError {
    SourceError::Usage(error.to_string())
}
