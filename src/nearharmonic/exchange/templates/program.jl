$head
# Indices below begin with 1, those above with 0. Run: julia $name.jl

const ${name}_$outer = [
$outer_rows
]

const ${name}_$inner = [
$inner_rows
]

"""
    ${name}!(kick!, drift!, tau, steps, q, p)

Take `steps` steps of length `tau` and change the vectors `q` and `p` in place.

Your system is two functions: `kick!(h, q, p)` does `p .-= h * dV/dq(q)`, `drift!(h, q, p)` does `q .+= h * dT/dp(p)`.
"""
function ${name}!(kick!, drift!, tau, steps, q, p)
    steps < 1 && return q, p
    stages = length(${name}_$inner)
    $outer!(${name}_$outer[1] * tau, q, p)
    for step in 1:steps, i in 1:stages
        $inner!(${name}_$inner[i] * tau, q, p)
        c = ${name}_$outer[i + 1]
        if i == stages && step < steps
            c += ${name}_$outer[1] # the last $outer of this step and the first of the next are one
        end
        $outer!(c * tau, q, p)
    end
    return q, p
end

# Example, to be replaced: the Henon-Heiles system, V = (x^2 + y^2)/2 + x^2 y - y^3/3, T = (px^2 + py^2)/2.
function henon_heiles_kick!(h, q, p)
    x, y = q
    p[1] -= h * (x + 2x * y)
    p[2] -= h * (y + x^2 - y^2)
end

function henon_heiles_drift!(h, q, p)
    q .+= h .* p
end

q, p = [$three, $zero], [$zero, $four]
${name}!(henon_heiles_kick!, henon_heiles_drift!, 0.25, 80, q, p)
println("q = ", join(q, " "))
println("p = ", join(p, " "))
