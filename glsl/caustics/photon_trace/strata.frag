// Cumulative shares of the photons over the blocks of a light's view: columns 0 to BLOCKS - 1 within each row of blocks, the last
// column over the rows. The density of least variance in the picture is proportional to the root of the mean square contribution.
uniform sampler2D t_contribution;   // of the last frame: mean square of what a photon brings
layout(location = 0) out float o_share;

float wanted(ivec2 block) {
    return sqrt(max(texelFetch(t_contribution, block, 0).r, 0.0));
}

void main() {
    ivec2 cell = ivec2(gl_FragCoord.xy);
    float total = 0.0, below = 0.0, row = 0.0, left = 0.0;
    for (int y = 0; y < BLOCKS; ++y) {
        for (int x = 0; x < BLOCKS; ++x) {
            float value = wanted(ivec2(x, y));
            total += value;
            below += y <= cell.y ? value : 0.0;
            row += y == cell.y ? value : 0.0;
            left += y == cell.y && x <= cell.x ? value : 0.0;
        }
    }
    // Nothing known yet, or nothing seen: even.
    float known = total > 0.0 ? 1.0 - FLOOR : 0.0, scale = total > 0.0 ? known / total : 0.0;
    float even = (1.0 - known) / float(BLOCKS);
    float row_share = row * scale + even;
    if (cell.x == BLOCKS) o_share = cell.y == BLOCKS - 1 ? 1.0 : below * scale + float(cell.y + 1) * even;
    else o_share = cell.x == BLOCKS - 1 ? 1.0 : (left * scale + float(cell.x + 1) * even / float(BLOCKS)) / row_share;
}
