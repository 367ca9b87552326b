//! One image or several around one lidar: the pixel edges of all of them, and the objects that their instances show.
//!
//! Every camera adds the pixel edges of the points that it sees, so that where images overlap, they vote. An object that
//! two images show has an instance in each; the two are one label if the points that both cameras see agree. Images of
//! several moments label the points of their own (`moments`).

mod images;
mod moments;
mod same_objects;
mod shown;
mod slots;
mod view;

pub(crate) use images::Images;
pub use same_objects::Objects;
pub use view::View;
