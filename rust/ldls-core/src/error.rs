//! The one error type of the core. Its fields carry the numbers; its messages name what was given, what was expected
//! and how to mend it.

/// A fault of the input of the method.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A coordinate is too large for the graph's distances to mean anything.
    #[error(
        "points: row {row} has a coordinate of {value:e} m, expected |x|, |y|, |z| <= {limit:e} m; \
         pass metres, or NaN where there is no return"
    )]
    CoordinateOutOfRange {
        /// First row with such a coordinate.
        row: usize,
        /// The coordinate found, in metres.
        value: f64,
        /// The largest magnitude allowed, in metres.
        limit: f64,
    },

    /// The number of points does not fit the index type of the graph.
    #[error(
        "points: {points} points with {neighbors} neighbours each exceed the limit of {limit} {of}; split the cloud"
    )]
    TooManyPoints {
        /// Number of points given.
        points: usize,
        /// Neighbours asked for.
        neighbors: usize,
        /// The limit.
        limit: u64,
        /// The things that the limit counts.
        of: &'static str,
    },

    /// A camera matrix holds a value that is not finite.
    #[error(
        "camera: {matrix}[{row}, {column}] is {value}, expected finite numbers; was the calibration loaded whole?"
    )]
    CameraNotFinite {
        /// Name of the matrix.
        matrix: &'static str,
        /// Row of the value.
        row: usize,
        /// Column of the value.
        column: usize,
        /// The value.
        value: f64,
    },

    /// The projection maps space to a line or a point.
    #[error(
        "camera: the left 3 x 3 of projection has rank below 3 (diagonal {fx}, {fy}, {w}); \
         expected focal lengths that are not zero, as in [[fx, 0, cx, 0], [0, fy, cy, 0], [0, 0, 1, 0]]"
    )]
    CameraSingular {
        /// Entry (0, 0).
        fx: f64,
        /// Entry (1, 1).
        fy: f64,
        /// Entry (2, 2).
        w: f64,
    },

    /// The rigid transform is not rigid.
    #[error(
        "camera: the rotation of T_camera_lidar deviates from orthonormal by {deviation:.3e} (determinant {determinant:.4}), \
         expected at most {limit:e} and determinant 1; {hint}"
    )]
    CameraNotRigid {
        /// Largest entry of |R^T R - I|.
        deviation: f64,
        /// Determinant of R.
        determinant: f64,
        /// Deviation allowed.
        limit: f64,
        /// What may have happened.
        hint: &'static str,
    },

    /// The last row of a rigid transform is not 0 0 0 1.
    #[error(
        "camera: the last row of T_camera_lidar is {found:?}, expected [0, 0, 0, 1]; is the matrix transposed?"
    )]
    CameraLastRow {
        /// The row found.
        found: [f64; 4],
    },

    /// The intrinsic matrix of a distorted camera is of another form.
    #[error(
        "camera: the last row of K is {found:?}, expected [0, 0, 1]; a distorted camera needs the 3 x 3 intrinsic matrix \
         of the raw image, not a projection of the rectified one"
    )]
    CameraIntrinsic {
        /// The row found.
        found: [f64; 3],
    },

    /// A distortion coefficient that is not finite.
    #[error("camera: a distortion coefficient is {value}, expected finite numbers")]
    Distortion {
        /// The coefficient found.
        value: f64,
    },

    /// An image without pixels, or too large to hold.
    #[error("masks: image of {height} x {width} pixels, expected 1 to {limit} pixels in all")]
    ImageSize {
        /// Rows of the image.
        height: usize,
        /// Columns of the image.
        width: usize,
        /// Most pixels allowed.
        limit: usize,
    },

    /// A mask is of another size than its image.
    #[error(
        "mask {index}: {found_height} x {found_width} pixels, the image is {height} x {width}{hint}"
    )]
    MaskSize {
        /// Position of the mask, from 0.
        index: usize,
        /// Rows of the mask.
        found_height: usize,
        /// Columns of the mask.
        found_width: usize,
        /// Rows of the image.
        height: usize,
        /// Columns of the image.
        width: usize,
        /// "; swapped?" where height and width are exchanged.
        hint: &'static str,
    },

    /// Runs do not cover the image.
    #[error(
        "RLE: runs sum to {found}, size {height} x {width} needs {expected}; is the size given as [height, width]?"
    )]
    RunSum {
        /// Sum of the runs.
        found: u64,
        /// Pixels of the image.
        expected: u64,
        /// Rows of the image.
        height: usize,
        /// Columns of the image.
        width: usize,
    },

    /// A compressed run-length string breaks its own rules.
    #[error(
        "RLE: byte {offset} of counts: {problem}; expected the compressed string that COCO tools write"
    )]
    RleString {
        /// Offset in the string.
        offset: usize,
        /// The fault there.
        problem: &'static str,
    },

    /// A polygon that has no meaning.
    #[error(
        "polygon: {problem}; expected a flat list x1, y1, x2, y2, ... of at least 3 points in pixels, near the image"
    )]
    Polygon {
        /// The fault.
        problem: String,
    },

    /// More instances than labels can count.
    #[error("masks: {found} instances, expected at most {limit}")]
    TooManyInstances {
        /// Number of masks.
        found: usize,
        /// The limit.
        limit: usize,
    },

    /// A parameter outside its range.
    #[error("{name}: got {found}, expected {expected}")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// The value found.
        found: String,
        /// The values allowed.
        expected: &'static str,
    },

    /// There is not enough memory.
    #[error("not enough memory for an array of {bytes} bytes; split the cloud, or free memory")]
    OutOfMemory {
        /// Size of the array that there is no memory for.
        bytes: usize,
    },

    /// The caller asked the work to stop.
    #[error("cancelled")]
    Cancelled,

    /// Arrays that belong together do not fit.
    #[error("{name}: {problem}")]
    Mismatch {
        /// Name of the argument.
        name: &'static str,
        /// The misfit.
        problem: String,
    },
}
