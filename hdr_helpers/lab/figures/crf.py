"""Figures of stage 3: the response curve, the matrix, the data on the curve."""

import numpy as np
from matplotlib.patches import Rectangle

from hdr_helpers.lab.figures.style import (
    ACCENT,
    CHANNELS,
    INK,
    MUTED,
    THREE,
    bare,
    headline,
    new_figure,
    plain,
)


def doubling_figure(bracket, point):
    """Pixel value against exposure time for one pixel, beside what a linear camera would have recorded."""
    row, col = point
    values = np.array([image[row, col, 1] for image in bracket.images], dtype=float)
    first = np.argmax(values > 40)
    fig, ax = new_figure(1, 1, 3.4)
    ax.plot(bracket.times, values, "o-", color=THREE[0][0], label="what this camera recorded")
    linear = np.minimum(values[first] * bracket.times / bracket.times[first], 255)
    ax.plot(bracket.times, linear, "^--", color=THREE[1][0], label="what a linear camera would have recorded")
    ax.set(xscale="log", xlabel="exposure time (s)", ylabel="pixel value (green)", ylim=(0, 265))
    ax.legend(frameon=False, loc="upper left")
    plain(ax)
    headline(fig, "Twice the light is not twice the pixel value")
    return fig


def sampling_figure(image, rows, cols):
    """Where the samples lie in the picture."""
    fig, (left, right) = new_figure(1, 2, 3.4, width_ratios=[1.4, 1])
    bare(left)
    left.imshow(image)
    left.scatter(cols, rows, s=26, marker="o", facecolor="none", edgecolor="white", lw=2.2)
    left.scatter(cols, rows, s=26, marker="o", facecolor="none", edgecolor=ACCENT, lw=1.2)
    right.hist(image[rows, cols, 1], bins=np.arange(0, 257, 16), color=ACCENT, edgecolor=INK)
    right.set(xlabel="pixel value (green) in this photograph", ylabel="samples")
    plain(right)
    headline(fig, f"{len(rows)} samples, spread over the picture and over its brightness")
    return fig


def matrix_figure(A, n_data):
    """Where the matrix A of the least-squares problem is not zero, and what its blocks are.

    A : (rows, 256 + N) with n_data data rows first, then the gauge row, then smoothness
    """
    fig, ax = new_figure(1, 1, 5.2)
    rows, cols = np.nonzero(A)
    ax.plot(cols, rows, ".", ms=2.2, color=INK, mec="none")
    height, width = A.shape
    for top, bottom, colour, text in (
        (0, n_data, THREE[0][0], "data:\none row for each sample\nin each photograph"),
        (n_data, n_data + 1, ACCENT, "gauge: one row"),
        (n_data + 1, height, THREE[1][0], "smoothness: 254 rows"),
    ):
        box = Rectangle((-0.5, top - 0.5), width, bottom - top, fill=False, ec=colour, lw=1.8)
        ax.add_patch(box)
        ax.annotate(text, (width, (top + bottom) / 2), (8, 0), textcoords="offset points", va="center",
                    color=colour, weight="bold", annotation_clip=False)  # fmt: skip
    ax.axvline(255.5, color=MUTED, ls="--", lw=1)
    ax.set(
        xlim=(-1, width),
        ylim=(height, -1),
        ylabel="row",
        xlabel="unknown: 256 values of g, then ln E of each sample",
    )
    headline(fig, f"A is {height} x {width}, and {100 * len(rows) / A.size:.2f}% of it is not zero")
    return fig


def data_on_curve_figure(Z, B, g, log_E, title="Measured points fall onto one curve"):
    """Samples before and after their log irradiance is known, as in the paper's figure 2.

    Z : (N, P), B : (P,), g : (256,), log_E : (N,)
    """
    fig, fill = data_on_curve_frame((B.min(), B.max()), (g.min(), g.max()))
    fill(Z, B, g, log_E, title)
    return fig


def data_on_curve_frame(log_times, curve):
    """The same without data: a Figure, and what fills it, to be called with the arguments of data_on_curve_figure.

    log_times, curve : least and greatest of B and of g that is to be seen
    """
    fig, (left, right) = new_figure(1, 2, 3.6, sharex=True)
    apart = [left.plot([], [], marker + "-", ms=4, lw=0.8, color=colour)[0] for colour, _, marker in THREE]
    (together,) = right.plot([], [], ".", ms=2, color=MUTED, label="samples")
    (line,) = right.plot([], [], color=THREE[0][0], lw=2, label="g")
    margin = 0.05 * (log_times[1] - log_times[0])
    left.set(xlabel="pixel value Z", ylabel="ln dt", ylim=(log_times[0] - margin, log_times[1] + margin))
    right.set(xlabel="pixel value Z", ylabel="ln E + ln dt", ylim=(curve[0] - 0.7, curve[1] + 0.7), xlim=(-13, 268))
    left.set_title("each sample its own curve: E is unknown", fontsize=10)
    right.set_title("shifted by its ln E: one curve", fontsize=10)
    legend, message = right.legend(frameon=False, loc="lower right"), headline(fig, "")
    plain(left)
    plain(right)

    def fill(Z, B, g, log_E, title):
        known = np.flatnonzero(np.isfinite(log_E))
        few = known[np.argsort(Z[known].sum(axis=1))][:: max(1, len(known) // 12)]
        gap = [np.nan]  # between the samples that are drawn as one broken line
        for k, samples in enumerate(apart):
            mine = Z[few[k :: len(apart)]]
            samples.set_data([x for values in mine for x in (*values, *gap)], [*B, *gap] * len(mine))
        together.set_data(Z[known].ravel(), (log_E[known, None] + B).ravel())
        line.set_data(np.arange(256), g)
        message.set_text(title)
        return [*apart, together, line, *left.spines.values(), *right.spines.values(), legend, message]

    return fig, fill


def crf_figure(crf, title="Response curve of the camera"):
    """Log inverse response of three channels, and the same the other way round. crf : (3, 256)"""
    fig, (left, right) = new_figure(1, 2, 3.9)
    z = np.arange(256)
    for c, (name, colour, style, marker) in enumerate(CHANNELS):
        for ax, flip in ((left, 1), (right, -1)):
            ax.plot(
                *(z, crf[c])[::flip],
                color=colour,
                ls=style,
                marker=marker,
                markevery=(8 + 12 * c, 48),
                label=name,
            )
    low, high = crf[:, 2].min() - 0.5, crf.max() + 0.5
    left.set(xlabel="pixel value Z", ylabel="log exposure g(Z)", xlim=(0, 255), ylim=(low, high))
    right.set(ylabel="pixel value Z", xlabel="log exposure ln(E dt)", ylim=(0, 255), xlim=(low, high))
    left.set_title("inverse response: what a pixel value means", fontsize=10)
    right.set_title("response: what the camera makes of light", fontsize=10)
    left.legend(frameon=False)
    plain(left)
    plain(right)
    headline(fig, title)
    return fig


def joint_figure(joint, u, v, titles):
    """How often two photographs read which pair of pixel values, and the pairs that belong together.

    joint : (256, 256) counts of u in the longer and v in the shorter photograph; u, v : (K,) the pairs
    titles : names of the longer and the shorter photograph
    """
    fig, (left, right) = new_figure(1, 2, 4.4)
    for ax, (low, high) in ((left, (0, 255)), (right, (90, 130))):
        ax.imshow(np.log1p(joint.T), origin="lower", cmap="Greys", aspect="auto")
        ax.plot(u, v, color=THREE[0][0], lw=2 if ax is left else 0, marker="o" if ax is right else "", ms=4,
                label="median of each column")  # fmt: skip
        ax.set(xlabel=f"pixel value u at {titles[0]}", xlim=(low, high))
        ax.legend(frameon=False, loc="upper left")
    inside = (u >= 90) & (u <= 130)
    left.set(ylabel=f"pixel value v at {titles[1]}", ylim=(0, 255))
    right.set(ylim=(v[inside].min() - 12, v[inside].max() + 12))
    left.set_title("all pixels of the green channel", fontsize=10)
    right.set_title("a part of it: noise spreads v, its median stays", fontsize=10)
    headline(fig, "Two exposures of one scene tie each pixel value to another one")
    return fig


def edges_figure(image, places, crf, truth):
    """The pixels on soft edges that tell a response from one photograph, and that response.

    image : (H, W, 3) uint8; places : (n, 2) rows and columns; crf, truth : (3, 256)
    """
    fig, (left, right) = new_figure(1, 2, 3.6, width_ratios=[1.4, 1])
    bare(left)
    left.imshow(image)
    left.scatter(places[:, 1], places[:, 0], s=12, facecolor="none", edgecolor="white", lw=1.6)
    left.scatter(places[:, 1], places[:, 0], s=12, facecolor="none", edgecolor=ACCENT, lw=0.9)
    left.set_title(f"{len(places)} pixels that mix two plain colours", fontsize=10)
    z = np.arange(5, 251)
    for (name, colour, style, _), found, true in zip(CHANNELS, crf, truth, strict=True):
        right.plot(z, found[z], style, color=colour, label=f"{name}, from the edges")
        right.plot(z, true[z], color=colour, lw=0.8, alpha=0.6)
    right.plot([], [], color=MUTED, lw=0.8, label="thin: the truth")
    right.set(xlabel="pixel value Z", ylabel="log exposure g(Z)")
    right.legend(frameon=False)
    plain(right)
    headline(fig, "A single photograph tells the response roughly, from the colours of its edges")
    return fig


def crf_error_figure(curves, truth, title, reach=0.42, errors=None):
    """Error of log inverse responses in stops against the pixel value, a panel for each channel.

    curves : name -> (3, 256); truth : (3, 256). The gauge, one constant a curve, is removed.
    reach : stops that the axis shows up and down
    errors : (3, 256) standard errors, ln exposure, drawn round 0; the gauge then is held at 128, as theirs is
    """
    fig, axes = new_figure(1, 3, 3.4, sharey=True)
    z = np.arange(5, 251)
    if errors is not None:
        for ax, error in zip(axes, errors[:, z] / np.log(2), strict=True):
            ax.fill_between(z, -error, error, color=MUTED, alpha=0.35, lw=0, label="one standard error")
    for c, (ax, (name, *_)) in enumerate(zip(axes, CHANNELS, strict=True)):
        for (who, curve), (colour, style, _) in zip(curves.items(), THREE, strict=False):
            error = (curve[c, z] - truth[c, z]) / np.log(2)
            ax.plot(z, error - (error.mean() if errors is None else 0), style, color=colour, label=who)
        ax.axhline(0, color=INK, lw=0.8)
        ax.set(xlabel="pixel value Z", ylim=(-reach, reach))
        ax.set_title(name, fontsize=10)
        plain(ax)
    axes[0].set_ylabel("error of g (stops)")
    axes[0].legend(frameon=False, loc="lower center")
    headline(fig, title)
    return fig
