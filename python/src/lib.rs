//! Native half of the Python package `bokehcam`: the Python half checks the type and shape of arguments, and passes
//! contiguous arrays. User docstrings are in the Python half.

mod aperture;
mod arrays;
mod blur;
mod coc;
mod errors;
mod files;
mod pictures;
mod recording;
mod signals;
mod stereo;
mod still;

use pyo3::prelude::*;

/// See the stubs in `bokehcam/_core.pyi`.
#[pymodule]
mod _core {
    #[pymodule_export]
    use crate::aperture::Aperture;
    #[pymodule_export]
    use crate::arrays::survey;
    #[pymodule_export]
    use crate::blur::Blur;
    #[pymodule_export]
    use crate::coc::coc_from_depth;
    #[pymodule_export]
    use crate::files::{read_depth, read_image, write_image};
    #[pymodule_export]
    use crate::recording::Recording;
    #[pymodule_export]
    use crate::stereo::Matcher;
    #[pymodule_export]
    use crate::still::{Still, refine};

    use super::{Bound, PyModule, PyModuleMethods, PyResult};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        bokehcam_live::source::register_look_files();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
