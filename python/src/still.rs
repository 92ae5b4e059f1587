//! Still pictures with depth, blurred like the command `render`.

use std::path::Path;
use std::sync::Mutex;

use bokehcam::bokeh::slices::{Radii, SliceBlur};
use bokehcam::depth::backdrop::Background;
use bokehcam::engine::still::{Depth, compute_coc_and_depth};
use bokehcam::look::{Change, Look, LookFacts, Metres, Refine};
use bokehcam_media::recording::still::check_depth_size;
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArrayDyn, ToPyArray};
use pyo3::prelude::*;

use crate::aperture::Aperture;
use crate::arrays::Image;
use crate::blur::blur;
use crate::signals::wait_for;
use crate::{errors, pictures};

/// A look for pictures of one size, and its executor.
#[pyclass(frozen, module = "bokehcam._core")]
pub struct Still {
    look: Look,
    threads: Option<usize>,
    /// `None` if pictures pass unchanged.
    executor: Option<Mutex<SliceBlur>>,
}

#[pymethods]
impl Still {
    /// Creates a renderer for pictures of `size` (width, height), with depth or without; `aperture` replaces that of
    /// the settings.
    #[new]
    fn new(
        py: Python<'_>,
        size: (u32, u32),
        has_depth: bool,
        settings: Vec<(String, String)>,
        aperture: Option<&Aperture>,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let mut look = errors::look(&settings)?;
        if let Some(Aperture { shape, rim }) = aperture {
            (look.aperture, look.rim) = (shape.clone(), *rim);
        }
        let facts = LookFacts { has_depth, metres: Metres::Known, size, ..LookFacts::default() };
        let (look, _) = look.change(&Change::default(), &facts).map_err(errors::value)?;
        let executor = look.blur_settings(size, false).map(|settings| SliceBlur::new(&settings, size, threads));
        let executor = py.detach(|| executor.transpose()).map_err(errors::value)?.map(Mutex::new);
        Ok(Self { look, threads, executor })
    }

    /// Blurs `image` (height, width, 3) into `out`; its `depth` in metres may have holes and noise.
    fn render(
        &self,
        py: Python<'_>,
        image: &Bound<'_, PyAny>,
        depth: Option<PyReadonlyArrayDyn<'_, f32>>,
        out: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let Some(executor) = &self.executor else {
            match Image::from_arrays(image, out)? {
                Image::Srgb(image, mut out) => out.as_slice_mut()?.copy_from_slice(image.as_slice()?),
                Image::Linear(image, mut out) => out.as_slice_mut()?.copy_from_slice(image.as_slice()?),
            }
            return Ok(());
        };
        let arrays = Image::from_arrays(image, out)?;
        if matches!(arrays, Image::Linear(..)) && self.look.background != Background::Blur {
            return Err(errors::value("behind: a virtual background needs 8-bit sRGB: give a uint8 image"));
        }
        let mut color = match &arrays {
            Image::Srgb(image, _) => pictures::color(image.as_any())?,
            Image::Linear(image, _) => pictures::color(image.as_any())?,
        };
        let map = depth.as_ref().map(pictures::depth).transpose()?;
        if let Some(map) = &map {
            check_depth_size(Path::new("depth"), map.size(), color.size()).map_err(errors::value)?;
        }
        let (look, threads) = (self.look.clone(), self.threads);
        let (color, made) = wait_for(py, move || {
            let made = compute_coc_and_depth(&look, &mut color, map.map(Depth::Measured), threads);
            (color, made)
        })?;
        let (field, map) = made.map_err(errors::value)?;
        let radii = Radii::Field(&field, map.as_ref());
        match arrays {
            // The virtual background may have been put into the picture.
            Image::Srgb(_, mut out) => blur(py, executor, &color.rgb, radii, out.as_slice_mut()?),
            Image::Linear(image, mut out) => blur(py, executor, image.as_slice()?, radii, out.as_slice_mut()?),
        }
    }
}

/// Refines depth in metres (height, width) by its picture, with the focus of the settings.
#[pyfunction]
pub fn refine<'py>(
    py: Python<'py>,
    depth: PyReadonlyArrayDyn<'py, f32>,
    image: &Bound<'py, PyAny>,
    settings: Vec<(String, String)>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let look = Look { refine: Refine::On, ..errors::look(&settings)? };
    let (map, mut color) = (pictures::depth(&depth)?, pictures::color(image)?);
    check_depth_size(Path::new("depth"), map.size(), color.size()).map_err(errors::value)?;
    let made = wait_for(py, move || compute_coc_and_depth(&look, &mut color, Some(Depth::Measured(map)), None))?;
    let (_, map) = made.map_err(errors::value)?;
    let map = map.ok_or_else(|| errors::value("refine: the settings are for a blur without depth"))?;
    map.metres.to_pyarray(py).reshape([map.height as usize, map.width as usize])
}
