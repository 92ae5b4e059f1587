//! Conversion of pictures in GStreamer's memory to sRGB and back, by the library.

use bokehcam::color::YcbcrMatrix;
use bokehcam::frame::ColorImage;
use bokehcam_live::capture::pixels::Decoder;
use bokehcam_live::layout::{ColorEncoding, FourCc, Layout, MAX_SIDE_PX, Plane, Range, Transfer};
use bokehcam_live::sink::raw::Encoder;
use gst_video::prelude::*;
use gst_video::{VideoColorMatrix, VideoColorRange, VideoFormat, VideoFrameRef, VideoInfo};

/// Returns the caps of the pads `sink` and `src`.
pub fn caps() -> gst::Caps {
    let sides = 1..=MAX_SIDE_PX as i32;
    let mut caps = gst_video::VideoCapsBuilder::new()
        .format_list([VideoFormat::Rgb, VideoFormat::Rgbx, VideoFormat::Nv12, VideoFormat::I420])
        .width_range(sides.clone())
        .height_range(sides.clone())
        .build();
    // YUY2 needs an even width: half a pixel pair has no unique layout.
    let mut paired = gst_video::VideoCapsBuilder::new().format(VideoFormat::Yuy2).height_range(sides).build();
    paired.make_mut().set("width", gst::IntRange::with_step(2, MAX_SIDE_PX as i32, 2));
    caps.make_mut().append(paired);
    caps
}

/// Converter for pictures of one format and size.
#[derive(Debug)]
pub struct Pictures {
    caps: gst::Caps,
    info: VideoInfo,
    decoder: Option<Decoder>,
    encoder: Option<(Layout, Encoder)>,
}

impl Pictures {
    /// Creates a converter for these caps.
    ///
    /// # Errors
    /// Fails if they do not match [`caps`].
    pub fn new(caps: gst::Caps) -> Result<Self, String> {
        let info = VideoInfo::from_caps(&caps).map_err(|error| error.to_string())?;
        Ok(Self { caps, info, decoder: None, encoder: None })
    }

    /// Returns the caps.
    pub fn caps(&self) -> gst::Caps {
        self.caps.clone()
    }

    /// Returns width and height, in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.info.width(), self.info.height())
    }

    /// Returns the frame period, if constant.
    pub fn period(&self) -> Option<gst::ClockTime> {
        // 0/1 is a variable rate.
        let fps = Some(self.info.fps()).filter(|fps| fps.numer() > 0)?;
        gst::ClockTime::SECOND.mul_div_round(fps.denom() as u64, fps.numer() as u64)
    }

    /// Decodes a picture. Allocates nothing while the row strides stay the same.
    ///
    /// # Errors
    /// Fails if the memory is too small.
    pub fn read(&mut self, buffer: &gst::BufferRef, into: &mut ColorImage) -> Result<(), String> {
        let frame = VideoFrameRef::from_buffer_ref_readable(buffer, &self.info).map_err(|error| error.to_string())?;
        if self.info.format() == VideoFormat::Rgbx {
            into.resize(self.info.width(), self.info.height());
            let stride = frame.plane_stride()[0] as usize;
            let rows = frame.planes_data()[0].chunks(stride);
            for (row, rgb) in rows.zip(into.rgb.chunks_exact_mut(3 * self.info.width() as usize)) {
                for (rgb, rgbx) in rgb.as_chunks_mut::<3>().0.iter_mut().zip(row.as_chunks::<4>().0) {
                    *rgb = [rgbx[0], rgbx[1], rgbx[2]];
                }
            }
            return Ok(());
        }
        let layout = layout(&self.info, frame.plane_stride())?;
        let decoder = match &mut self.decoder {
            Some(decoder) if *decoder.layout() == layout => decoder,
            other => other.insert(Decoder::new(&layout).map_err(|error| error.to_string())?),
        };
        let planes = frame.planes_data();
        decoder.decode(&planes[..layout.planes().len()], into).map_err(|error| error.to_string())
    }

    /// Encodes a picture, the inverse of [`Pictures::read`].
    ///
    /// # Errors
    /// Fails if the memory is too small.
    pub fn write(&mut self, picture: &ColorImage, buffer: &mut gst::BufferRef) -> Result<(), String> {
        let mut frame =
            VideoFrameRef::from_buffer_ref_writable(buffer, &self.info).map_err(|error| error.to_string())?;
        let strides: [i32; 4] = std::array::from_fn(|plane| frame.plane_stride().get(plane).copied().unwrap_or(0));
        let mut planes = frame.planes_data_mut();
        if self.info.format() == VideoFormat::Rgbx {
            let rows = planes[0].chunks_mut(strides[0] as usize);
            for (row, rgb) in rows.zip(picture.rgb.chunks_exact(3 * self.info.width() as usize)) {
                for (rgbx, rgb) in row.as_chunks_mut::<4>().0.iter_mut().zip(rgb.as_chunks::<3>().0) {
                    *rgbx = [rgb[0], rgb[1], rgb[2], u8::MAX];
                }
            }
            return Ok(());
        }
        let layout = layout(&self.info, &strides)?;
        let encoder = match &mut self.encoder {
            Some((made_for, encoder)) if *made_for == layout => encoder,
            other => {
                &mut other
                    .insert((layout, Encoder::new(&layout).ok_or("pictures cannot be converted back to this format")?))
                    .1
            }
        };
        let count = layout.planes().len();
        if (0..count).any(|plane| planes[plane].len() < layout.min_size_bytes(plane)) {
            return Err("the buffer is too small for a picture".to_owned());
        }
        encoder.encode(picture, &mut planes[..count]);
        Ok(())
    }
}

/// Returns the library's layout of a picture with these row strides, in bytes, for each plane.
fn layout(info: &VideoInfo, strides: &[i32]) -> Result<Layout, String> {
    let fourcc = match info.format() {
        VideoFormat::Rgb => FourCc::RGB3,
        VideoFormat::Yuy2 => FourCc::YUYV,
        // The multi-planar variants: GStreamer gives each plane's memory.
        VideoFormat::Nv12 => FourCc(*b"NM12"),
        VideoFormat::I420 => FourCc(*b"YM12"),
        other => return Err(format!("{other} cannot be read")),
    };
    let plane = |&stride: &i32| Plane { stride_bytes: usize::try_from(stride).unwrap_or(0), size_bytes: 0 };
    let count = info.n_planes() as usize;
    let planes: [Plane; 4] = std::array::from_fn(|at| strides.get(at).map_or(Plane::default(), plane));
    Layout::new(fourcc, (info.width(), info.height()), &planes[..count], Some(colors(info)))
        .map_err(|error| error.to_string())
}

/// Reads the caps' colorimetry. Transfer curves are not converted: all values are displayed as they are.
fn colors(info: &VideoInfo) -> ColorEncoding {
    let colorimetry = info.colorimetry();
    let matrix = match colorimetry.matrix() {
        VideoColorMatrix::Bt709 | VideoColorMatrix::Smpte240m => YcbcrMatrix::Bt709,
        VideoColorMatrix::Bt2020 => YcbcrMatrix::Bt2020,
        VideoColorMatrix::Unknown => YcbcrMatrix::for_height(info.height()),
        _ => YcbcrMatrix::Bt601,
    };
    let range = match colorimetry.range() {
        VideoColorRange::Range0_255 => Range::Full,
        VideoColorRange::Range16_235 => Range::Limited,
        _ if info.is_rgb() => Range::Full,
        _ => Range::Limited,
    };
    (matrix, range, Transfer::Display)
}

/// Chooses the buffer pool of the output: downstream's, or a new one.
///
/// # Errors
/// Fails if no pool supports the pictures.
pub fn decide_pool(query: &mut gst::query::Allocation) -> Result<(), String> {
    let caps = query.get_owned().0.ok_or("downstream requests buffers without a format")?;
    let info = VideoInfo::from_caps(&caps).map_err(|error| error.to_string())?;
    let takes_meta = query.find_allocation_meta::<gst_video::VideoMeta>().is_some();
    let configure = |pool: &gst::BufferPool, size: u32, min: u32, max: u32| {
        let mut config = pool.config();
        config.set_params(Some(&caps), size, min, max);
        if takes_meta {
            config.add_option(gst_video::BUFFER_POOL_OPTION_VIDEO_META);
        }
        pool.set_config(config)
    };
    let offered = query.allocation_pools().next();
    let (size, min, max) = offered.as_ref().map_or((0, 0, 0), |&(_, size, min, max)| (size, min, max));
    let size = size.max(info.size() as u32);
    let is_first = offered.is_none();
    // Downstream's pool may reject the configuration.
    let theirs = offered.and_then(|(pool, ..)| pool).filter(|pool| configure(pool, size, min, max).is_ok());
    let pool = match theirs {
        Some(pool) => pool,
        None => {
            let own = gst_video::VideoBufferPool::new().upcast();
            configure(&own, size, min, max).map_err(|error| error.to_string())?;
            own
        }
    };
    if is_first {
        query.add_allocation_pool(Some(&pool), size, min, max);
    } else {
        query.set_nth_allocation_pool(0, Some(&pool), size, min, max);
    }
    Ok(())
}
