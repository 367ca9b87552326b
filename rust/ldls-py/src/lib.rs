//! The private extension module `ldls._ldls`. It extracts arguments, checks them, releases the GIL, calls `ldls_core`
//! or `ldls_laz` and wraps what comes back. No algorithm lives here.

#![allow(
    clippy::needless_pass_by_value,
    reason = "pyo3 hands arguments over by value"
)]

mod allocator;
mod arrays;
mod call;
mod camera;
mod clouds;
mod errors;
mod laz;
mod masks;
mod pictures;
mod products;
mod segment;
mod stages;

/// Core of `ldls`; private, use `ldls`.
#[pyo3::pymodule]
mod _ldls {
    #[pymodule_export]
    use crate::call::{default_threads, panic_in_worker};
    #[pymodule_export]
    use crate::camera::Camera;
    #[pymodule_export]
    use crate::clouds::{brought_together, upright_box};
    #[pymodule_export]
    use crate::laz::unpack_laz;
    #[pymodule_export]
    use crate::masks::{Masks, Rle};
    #[pymodule_export]
    use crate::pictures::pack_png;
    #[pymodule_export]
    use crate::products::Products;
    #[pymodule_export]
    use crate::segment::{SegmentationArrays, check_params, segment};
    #[pymodule_export]
    use crate::stages::{
        confidence, depth_groups, diffuse, direct_labels, ground, in_graph, neighbors,
        normalize_rows, pixel_labels, point_graph, project, remove_outliers,
    };

    #[pymodule_init]
    fn init(module: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
        use pyo3::types::PyModuleMethods;
        crate::call::remember_panics();
        crate::allocator::keep_for_a_while();
        module.add("GROUND_M", ldls_core::GROUND_M)?;
        module.add("NEGLIGIBLE", <f32 as ldls_core::Real>::NEGLIGIBLE)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
